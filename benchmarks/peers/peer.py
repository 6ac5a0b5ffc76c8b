"""What is asked of a compared renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.scene.model import Scene

FloatImage = npt.NDArray[np.float32]


class MissingPeer(Exception):  # noqa: N818 - a renderer that is not installed is no error
    """The renderer is not installed or cannot run here; the message says what to do."""


@dataclass(frozen=True)
class Job:
    """What is rendered. `max_bounces` are scattering events after the first hit; `transmission_bounces` are
    passages through glass, which only incpt counts apart: others get the larger of both in all."""

    scene: Scene
    size: tuple[int, int]
    max_bounces: int
    transmission_bounces: int
    threads: int

    @property
    def glassy(self) -> bool:
        """Whether anything in the scene is transparent."""
        return any(material.transmission > 0 for material in self.scene.materials.values())

    @property
    def all_bounces(self) -> int:
        """For renderers that count passages through glass with the rest."""
        return max(self.max_bounces, self.transmission_bounces) if self.glassy else self.max_bounces

    @property
    def pixels(self) -> int:
        """Of the picture."""
        return self.size[0] * self.size[1]


class Peer(Protocol):
    """A renderer. All methods may raise MissingPeer."""

    def load(self, job: Job) -> None:
        """Take another scene; whatever can be built or compiled before rendering may be done here."""

    def time(self, spp: int, seed: int) -> float:
        """Seconds for tracing `spp` samples per pixel of the loaded scene, in as large parts as suits it."""

    def image(self, spp: int, seed: int) -> FloatImage:
        """(H, W, 3) mean radiance of that many samples; row 0 is on top."""

    def move(self, name: str, position: Vector, seed: int) -> float:
        """Put an object elsewhere; seconds until a picture with one sample per pixel shows it there."""


PEERS = ("incpt", "mitsuba llvm_ad_rgb", "mitsuba scalar_rgb", "cycles", "cycles with light tree")


def make(name: str) -> Peer:
    """The adapter of a renderer, by its name in PEERS. Raises MissingPeer."""
    if name == "incpt":
        from incpt.benchmarks.peers.incpt_peer import IncptPeer

        return IncptPeer()
    if name.startswith("mitsuba "):
        from incpt.benchmarks.peers.mitsuba_peer import MitsubaPeer

        return MitsubaPeer(name.split(" ", 1)[1])
    assert name in PEERS, name
    from incpt.benchmarks.peers.cycles_peer import CyclesPeer

    return CyclesPeer(light_tree=name.endswith("light tree"))
