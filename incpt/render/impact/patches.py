"""Patches: the pieces of a picture that the kernels of cl/impact/ work on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from incpt.core import bindings, layout
from incpt.device.device import Device

_PATCH_PIXELS = layout.PATCH_WIDTH * layout.PATCH_HEIGHT


@dataclass(frozen=True)
class Patches:
    """A picture of `width` x `height` pixels on a device, cut into patches.

    CPUs under clang get a work-item for each patch, in whose loops the compiler finds SIMD lanes; other
    devices one for each pixel, and a group of them for each patch. See cl/impact/patch.cl.
    """

    device: Device
    width: int
    height: int

    @property
    def columns(self) -> int:
        """Patches side by side."""
        return -(-self.width // layout.PATCH_WIDTH)

    @property
    def count(self) -> int:
        """All patches."""
        return self.columns * -(-self.height // layout.PATCH_HEIGHT)

    @property
    def cells(self) -> int:
        """All cells."""
        return -(-self.width // layout.CELL_SIZE) * -(-self.height // layout.CELL_SIZE)

    @property
    def field_size(self) -> int:
        """Floats of a plane with a margin."""
        margin = 2 * layout.FIELD_MARGIN
        return (self.columns * layout.PATCH_WIDTH + margin) * (self.height + margin)

    @property
    def nothing(self) -> Patches:
        """A picture without pixels, for launches that only build a kernel."""
        return Patches(self.device, 1, 0)

    def launch(self, name: str, file: str, values: Mapping[str, Any], least: int = 1) -> None:
        """Launch a kernel of cl/`file`.cl over all patches, `least` of them at least."""
        group = 1 if self.device.is_clang_cpu else _PATCH_PIXELS
        self._launch(name, file, values, max(self.count, least) * group, group)

    def launch_columns(
        self, name: str, file: str, values: Mapping[str, Any], rows: int, least: int = 1
    ) -> None:
        """Launch a kernel over all columns of `rows` pixels, which a work-item sums up."""
        group = 1 if self.device.is_clang_cpu else layout.PATCH_WIDTH
        strips = self.columns * -(-self.height // rows)
        own = {"row_count": rows}
        self._launch(name, file, {**own, **values}, max(strips, least) * group, group)

    def launch_items(self, name: str, file: str, values: Mapping[str, Any], items: int) -> None:
        """Launch a kernel over so many work-items."""
        self._launch(name, file, values, items, None)

    def _launch(self, name: str, file: str, values: Mapping[str, Any], items: int, group: int | None) -> None:
        own = {"width": self.width, "height": self.height}
        arguments = bindings.arguments(bindings.KERNELS[name], {**own, **values})
        self.device.launch(self.device.kernel(name, file), items, *arguments, work_group=group)
