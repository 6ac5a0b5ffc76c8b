"""How the picture is shown, and what is laid over it: nothing here is rendered anew."""

from __future__ import annotations

from dataclasses import replace

from incpt.picture import denoise
from incpt.ui.preferences import DisplaySettings
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

CURVE_TEXTS = {"agx": "AgX", "filmic": "Filmic", "srgb": "sRGB, clipped"}
"""How the panel names the curves of tone mapping."""
OVERLAY_TEXTS = {
    "none": "None",
    "queue": "Order of the queue",
    "replaced": "Replaced tiles",
    "spp": "Samples per pixel",
    "object_ids": "Object ids",
    "normals": "Normals",
    "albedo": "Albedo",
    "depth": "Depth",
    "error_left": "Error left",
    "touched": "Changed paths",
    "pairs": "Pairs or singles",
    "weight": "Weight of the old picture",
}
"""How panel and menu name the overlays, in the order of the menu."""
SHADING_TEXTS = {"rendered": "Rendered", "material": "Material preview", "solid": "Solid"}
"""How panel and menu name the kinds of shading."""
SHADING_HELP = {
    "rendered": "By the path tracer",
    "material": "By OpenGL: textures, roughness and metal in a studio that moves with the camera",
    "solid": "By OpenGL: every object in the plain colour of its material",
}
"""What each kind is."""
_SHADING_TIP = (
    "By OpenGL, without shadows and the scene's light, the device rests: for editing where it is slow"
)
_DENOISE_TIP = (
    "For the eye alone: what is rendered stays as it is. Where little noise is left, nothing is denoised"
)


def draw(display: DisplaySettings, refusals: Refusals) -> DisplaySettings:
    """Fields of the display settings; returns them after this frame."""
    shading = widgets.choice("Shading", display.shading, list(SHADING_TEXTS.items()), _SHADING_TIP)
    exposure = widgets.number(
        "Exposure", display.exposure, low=-10.0, high=10.0, speed=0.02, unit=" EV", decimals=2
    )
    curve = widgets.choice("Curve", display.curve, list(CURVE_TEXTS.items()), "Tone mapping")
    denoised = widgets.checkbox("Denoise", display.denoise and denoise.is_available(), _DENOISE_TIP)
    display = refusals.accepted(display, lambda: _with_denoiser(display, denoised))
    overlay = widgets.choice("Overlay", display.overlay, list(OVERLAY_TEXTS.items()), "Laid over the picture")
    opacity = display.overlay_opacity
    if overlay != "none":
        opacity = widgets.number("Opacity", opacity, low=0.0, high=1.0, speed=0.01, decimals=2)
    grid = widgets.checkbox("Tile grid", display.tile_grid)
    floor_grid = widgets.checkbox("Floor grid", display.floor_grid, "Lines on the floor y = 0")
    axes = widgets.checkbox("Axes", display.axes, "Those of the world, in the corner of the picture")
    outline = widgets.checkbox("Outline", display.outline, "Around the selection, and marks of lights")
    split = widgets.checkbox("Split view", display.split, "Left: restart, right: the chosen strategy")
    return refusals.changed(
        display,
        shading=shading,
        exposure=exposure,
        curve=curve,
        overlay=overlay,
        overlay_opacity=opacity,
        tile_grid=grid,
        outline=outline,
        floor_grid=floor_grid,
        axes=axes,
        split=split,
    )


def _with_denoiser(display: DisplaySettings, is_on: bool) -> DisplaySettings:
    """Raises InputError where there is none to be switched on."""
    if is_on:
        denoise.require_denoiser()
    return display if is_on == display.denoise else replace(display, denoise=is_on)
