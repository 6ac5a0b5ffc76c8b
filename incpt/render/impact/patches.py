"""Patches: the pieces of a picture that the kernels of cl/impact/ work on, and launches over them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from incpt.core import bindings, layout
from incpt.device.device import Device

_ALIGNMENT = 16
"""Rows of planes with a margin begin so many floats apart, or a multiple: see cl/impact/patch.cl."""


@dataclass(frozen=True)
class Patches:
    """A picture of `width` x `height` pixels on a device, cut into patches.

    CPUs under clang get a work-item for each patch, in whose loops the compiler finds SIMD lanes; other
    devices a group of them, one for each column.
    """

    device: Device
    width: int
    height: int

    @property
    def count(self) -> int:
        """Patches of the height of a cell."""
        return self._across(self.width) * self.cell_rows

    @property
    def cell_columns(self) -> int:
        """Cells side by side."""
        return -(-self.width // layout.CELL_SIZE)

    @property
    def cell_rows(self) -> int:
        """Rows of cells."""
        return -(-self.height // layout.CELL_SIZE)

    @property
    def cells(self) -> int:
        """All cells."""
        return self.cell_columns * self.cell_rows

    @property
    def field_size(self) -> int:
        """Floats of a plane with a margin."""
        margin = 2 * layout.FIELD_MARGIN
        row = -(-self.width // _ALIGNMENT) * _ALIGNMENT + margin
        return row * (self.height + margin)

    @property
    def nothing(self) -> Patches:
        """A picture without pixels, for launches that only build a kernel, of a patch each. PoCL builds
        kernels once for small grids and once for large ones, but the patches of a picture are a small one."""
        return Patches(self.device, 1, 0)

    def launch(
        self,
        name: str,
        file: str,
        values: Mapping[str, Any],
        rows: int = layout.CELL_SIZE,
        features: tuple[str, ...] = (),
    ) -> None:
        """Launch a kernel of cl/`file`.cl over all patches, of `rows` rows of pixels each."""
        patches = self._across(self.width) * -(-self.height // rows)
        self._launch_patches(name, file, values, patches, features)

    def launch_rows(self, name: str, file: str, values: Mapping[str, Any], rows: int) -> None:
        """Launch a kernel over patches one row high, of so many rows as long as those of the picture."""
        self._launch_patches(name, file, values, self._across(self.width) * rows, ())

    def launch_cells(self, name: str, file: str, values: Mapping[str, Any], planes: int) -> None:
        """Launch a kernel over patches of the cells of so many planes, one row high."""
        patches = self._across(self.cell_columns) * planes * self.cell_rows
        self._launch_patches(name, file, values, patches, ())

    def launch_items(self, name: str, file: str, values: Mapping[str, Any], items: int) -> None:
        """Launch a kernel over so many work-items."""
        self._launch(name, file, values, items, None, ())

    def _across(self, width: int) -> int:
        return -(-width // layout.PATCH_WIDTH)

    def _launch_patches(
        self,
        name: str,
        file: str,
        values: Mapping[str, Any],
        patches: int,
        features: tuple[str, ...],
    ) -> None:
        group = 1 if self.device.is_clang_cpu else layout.PATCH_WIDTH
        self._launch(name, file, values, max(patches, 1) * group, group, features)

    def _launch(
        self,
        name: str,
        file: str,
        values: Mapping[str, Any],
        items: int,
        group: int | None,
        features: tuple[str, ...],
    ) -> None:
        own = {"width": self.width, "height": self.height}
        arguments = bindings.arguments(bindings.KERNELS[name], {**own, **values})
        kernel = self.device.kernel(name, file, features)
        self.device.launch(kernel, items, *arguments, work_group=group)
