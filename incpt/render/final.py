"""Final renders: a picture of a scene with so many samples, or after so much time, into a file.

`FinalRender.step` does one bounded piece of work, so that whoever owns the loop can do something else in
between: the command line shows its progress, the editor goes on.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, OutputError
from incpt.core.settings import RenderSettings
from incpt.picture import denoise
from incpt.picture.denoise import NoiseGauge
from incpt.render.export import SUFFIXES, write_picture
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport

_FIRST_LOOK = 4
"""The samples per pixel from which on a picture that is to be denoised is looked at, each time they have
doubled, to tell how noisy it is."""


@dataclass(frozen=True)
class FinalSettings:
    """What a final render makes. Raises InputError for a suffix of no known format, for limits that cannot
    be, and where there is no denoiser and one is needed.

    path      .exr is linear radiance; .png is tone-mapped by `exposure` (EV) and `curve`.
    spp       samples per pixel at which it ends.
    seconds   of rendering after which it ends, once there is a whole picture; None: however long it takes.
    aovs      whether an .exr gets auxiliary images as layers; see `write_picture`. A .png has none.
    denoise   whether a .png is denoised, and an .exr gets a denoised picture as a layer.
    """

    path: Path
    spp: int = 256
    seconds: float | None = None
    aovs: bool = False
    denoise: bool = False
    exposure: float = 0.0
    curve: str = "agx"

    def __post_init__(self) -> None:
        if self.path.suffix.lower() not in SUFFIXES:
            raise InputError(f"{self.path}: ends in no known format; use .exr or .png")
        if self.spp < 1:
            raise InputError(f"spp: {self.spp} is no number of samples; use 1 or more")
        if self.seconds is not None and not self.seconds > 0:
            raise InputError(f"seconds: {self.seconds:g} is no time; use more than 0")
        if self.denoise:
            denoise.require_denoiser()

    def check_place(self) -> None:
        """Before the long work: raises OutputError where no file can be written at the path."""
        folder = self.path.parent
        if self.path.is_dir():
            raise OutputError(f"{self.path}: is a folder; name a file in it")
        if not folder.is_dir():
            raise OutputError(f"{folder}: no such folder; make it first")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OutputError(f"{folder}: cannot be written; choose another folder")

    def of_session(self, settings: RenderSettings) -> RenderSettings:
        """`settings` with the passes that are needed: base colours and normals help a denoiser."""
        return replace(settings, aovs=settings.aovs or self.aovs or self.denoise)


class FinalRender:
    """A final render of the scene of `session`, whose settings are those of `FinalSettings.of_session`."""

    def __init__(self, session: Session, wanted: FinalSettings) -> None:
        self.session, self.wanted = session, wanted
        self.seconds = 0.0
        """How long it has rendered."""
        self._gauge = NoiseGauge()
        self._looked_at = 0

    @property
    def spp(self) -> int:
        """The samples of the pixel that has the fewest."""
        return int(self.session.tile_spp.min())

    @property
    def is_whole(self) -> bool:
        """Whether all of the picture is there."""
        return self.session.mode is Mode.REFINE and not self.session.progress.has_stale

    @property
    def is_done(self) -> bool:
        """Whether there are as many samples as were asked for, or the time is over."""
        is_late = self.wanted.seconds is not None and self.seconds >= self.wanted.seconds
        return self.is_whole and (is_late or self.spp >= self.wanted.spp)

    @property
    def share(self) -> float:
        """How much of it is done, from 0 to 1."""
        share = float(np.minimum(self.session.tile_spp, self.wanted.spp).mean()) / self.wanted.spp
        if self.wanted.seconds is not None:
            share = max(share, self.seconds / self.wanted.seconds)
        return min(share, 1.0)

    def step(self, slots: int | None = None) -> StepReport:
        """Render one step; `slots` is that of `Session.step`."""
        report = self.session.step(slots)
        self.seconds += report.seconds
        if self.wanted.denoise and self.is_whole and self.spp >= max(2 * self._looked_at, _FIRST_LOOK):
            self._looked_at = self.spp
            self._gauge.look(self.session.image(), self.session.spp())
        return report

    def write(self) -> None:
        """Write the picture as it is now. Raises OutputError where that cannot be; the picture is then in the
        system's folder for temporary files, if that has room, and the error says so."""
        wanted = self.wanted
        denoised = self._denoised() if wanted.denoise else None

        def write_to(path: Path) -> None:
            write_picture(path, self.session, wanted.aovs, wanted.exposure, wanted.curve, denoised)

        try:
            write_to(wanted.path)
        except OutputError as error:
            # It may have taken hours.
            try:
                rescued = Path(tempfile.mkdtemp(prefix="incpt-")) / wanted.path.name
                write_to(rescued)
            except (OSError, OutputError):
                raise error from None
            raise OutputError(f"{error}; the picture is in {rescued}") from None

    def _denoised(self) -> npt.NDArray[np.float32]:
        """(H, W, 3) the picture with as much of a denoised one as its noise asks for."""
        image = self.session.image()
        self._gauge.look(image, self.session.spp())
        clean = denoise.denoise(image, self.session.pass_image("albedo"), self.session.pass_image("normal"))
        return denoise.mixed(image, clean, self._gauge.variance())
