"""Pairs of paths beside what all paths bring in both scenes, for the tests of `impact`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pyopencl as cl
import pytest

from incpt.core import layout
from incpt.device.device import Device
from incpt.render.impact.pairs import PairBuffers, PairTracer
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.model import Scene
from incpt.tables.change_tables import ChangeTables, change_tables
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import paired_tables
from support.renders import assert_same_mean, repeat

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class TracedPairs:
    """P paths in two scenes.

    new, old          (3, P) what they bring in each, traced in it whole.
    plain             (3, P) the first again, traced without the question what they meet.
    partner_place     (P,) see PairBuffers.
    partners          (K,) the paths that have a partner.
    partner_radiance  (3, K) what the partners brought.
    same_kernels      whether both scenes were traced by the same variant of the kernels; if not, a path that
                      is the same in both brings the same up to rounding.
    """

    new: Floats
    plain: Floats
    old: Floats
    partner_place: npt.NDArray[np.uint32]
    partners: npt.NDArray[np.uint32]
    partner_radiance: Floats
    same_kernels: bool

    @property
    def touched(self) -> npt.NDArray[np.bool_]:
        """(P,) whether each met something that changed."""
        return self.partner_place != layout.NO_INDEX

    @property
    def differ(self) -> npt.NDArray[np.bool_]:
        """(P,) whether each brings something else in the other scene, bit by bit where this can be asked."""
        if self.same_kernels:
            return np.asarray((bits(self.new) != bits(self.old)).any(axis=0))
        return np.asarray((np.abs(self.new - self.old) > 1e-3 * np.abs(self.old) + 1e-6).any(axis=0))


def bits(values: Floats) -> npt.NDArray[np.uint32]:
    """The same, to compare bit by bit."""
    return values.view(np.uint32)


def session_of(device: Device, scene: Scene, in_blocks: bool, spp: int = 1) -> Session:
    """One whose first step holds so many samples of each pixel."""
    settings = replace(scene.settings, base_nor=spp, sample_rate=1, slots_per_step=None)
    session = Session(scene, settings=settings, device=device)
    if not in_blocks:
        session._tracer = _wavefront_of(device)
    return session


@cache
def _wavefront_of(device: Device) -> Wavefront:
    """One for all tests: its state takes tens of megabytes."""
    return Wavefront(device)


def traced_pairs(
    device: Device,
    old: Scene,
    new: Scene,
    in_blocks: bool,
    spp: int = 16,
    changes: ChangeTables | None = None,
    single: npt.NDArray[np.bool_] | None = None,
) -> TracedPairs:
    """All paths of a step of the settings of `new`, with so many samples a pixel. `changes` stand in place of
    those that follow from the scenes; `single` (slots,) are the slots without partners."""
    session = session_of(device, new, in_blocks, spp)
    tile_size, count = session.settings.tile_size, spp * session.grid.count
    plan = session.progress.planned(count)
    slots = plan.slots.copy()
    if single is not None:
        slots["flags"][single] |= np.uint32(layout.SlotFlag.SINGLE)
    path_buffer = session._state.path_buffer.grown(device, count, tile_size)
    before = session._state.tables
    tables, new_tables = paired_tables(before.pool, old, new, before)
    batch = replace(session._batch(slots, path_buffer), tables=new_tables)
    paths = batch.path_count

    def read(buffer: cl.Buffer, stride: int, used: int) -> Floats:
        return device.read(buffer, np.empty((3, stride), np.float32))[:, :used].copy()

    def read_uints(buffer: cl.Buffer, used: int) -> npt.NDArray[np.uint32]:
        return device.read(buffer, np.empty(used, np.uint32))

    changes = change_tables(device, old, new) if changes is None else changes
    buffers = PairBuffers.of(device, path_buffer.stride)
    partners = PairTracer(session._tracer).trace(batch, tables, changes, buffers)
    new_radiance = read(path_buffer.floats, path_buffer.stride, paths)
    session._tracer.trace(batch)
    plain = read(path_buffer.floats, path_buffer.stride, paths)
    session._tracer.trace(replace(batch, tables=tables))
    return TracedPairs(
        new_radiance,
        plain,
        read(path_buffer.floats, path_buffer.stride, paths),
        read_uints(buffers.partner_place, paths),
        read_uints(buffers.partners, partners) if partners else np.zeros(0, np.uint32),
        read(buffers.partner_radiance, buffers.stride, partners),
        tables.variant == new_tables.variant,
    )


def check(pairs: TracedPairs, at_most: float = 1.0, differs: bool = True) -> None:
    """Every law of pairs: to ask changes nothing, a path that brings something else has met something that
    changed, and a partner brings what its path brings in the old scene. At most a share `at_most` is touched;
    `differs`: some path does bring something else."""
    np.testing.assert_array_equal(bits(pairs.new), bits(pairs.plain))
    missed = pairs.differ & ~pairs.touched
    assert not missed.any(), f"{missed.sum()} of {len(missed)} paths differ and met nothing that changed"
    listed = np.flatnonzero(pairs.touched & (pairs.partner_place != layout.NO_PARTNER))
    np.testing.assert_array_equal(pairs.partners, listed)
    np.testing.assert_array_equal(pairs.partner_place[listed], np.arange(len(listed)))
    np.testing.assert_array_equal(bits(pairs.partner_radiance), bits(pairs.old[:, listed]))
    assert pairs.differ.any() == differs
    assert pairs.touched.mean() <= at_most


def assert_choice_changes_no_mean(device: Device, old: Scene, new: Scene) -> None:
    """Choosing among the lights of both scenes brings, in either, what choosing among its own does."""
    pool = GeometryPool.of(device)
    for chosen, scene in enumerate((old, new)):
        plain = repeat(scene, 128, max_bounces=2)
        tables = paired_tables(pool, old, new)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("incpt.render.session.tables_of", lambda *_, both=tables, i=chosen: both[i])
            paired = repeat(scene, 128, max_bounces=2)
        assert_same_mean(plain, paired, relative=0.02)
