"""How the picture is rendered: what goes on, and the settings that decide it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from imgui_bundle import imgui

from incpt.core.settings import CUT_OFF_WORTH_TELLING, STRATEGIES, RenderSettings
from incpt.render.modes import Mode
from incpt.render.strategies import strategy_of
from incpt.scene.summary import described_textures
from incpt.ui.editor.state import Control
from incpt.ui.preferences import Preferences
from incpt.ui.widgets import places, widgets
from incpt.ui.widgets.refusals import Refusals
from incpt.viewer.view import Frame, Picture

MODE_TEXTS = {
    Mode.BASE: "Base: the first picture",
    Mode.REFINE: "Refine: more samples everywhere",
    Mode.INCREMENTAL: "Incremental: what the edit affects first",
}
"""What a mode is called where it is shown."""
STRATEGY_TEXTS = {"restart": "Restart", "spiral": "Spiral", "impact": "Impact"}
"""What a strategy is called where it is chosen; one that is not here is called by its name."""
_STRATEGY_TIP = (
    "Restart: an edit starts everything anew. Spiral: from the edit outwards, the rest is kept. "
    "Impact: what the edit changes is measured, and rendered where it is seen"
)
_FINDING_TEXT = "Finding what the edit changes"
_FOUND_TIP = (
    "What is left is the error of the change that the eye can see. At 100 % the picture is as good as before "
    "the edit"
)
_CUT_OFF_TIP = "Their light is missing; raise Glass bounces"
_ADAPTS_TIP = "NoR is the most: tiles get what the rest of the picture has, and the object's come at once"
_CLAMP_TIP = (
    "Against fireflies: the most that a sample adds at once after its first bounce; 0: all. Biased: it makes "
    "the picture darker than it should be"
)
_LIMIT_TIP = "Images with more pixels a side are halved on the device; 0: none is"
_TRANSPARENT_TIP = (
    "The environment lights the scene, but is not seen behind it: the picture gets an alpha for what it is "
    "laid over"
)
_WITHOUT_NOR = "The strategy that is chosen repeats no tiles"
_TILE_SIZES = (8, 16, 32, 64, 128)
"""Tile sizes that are offered, in pixels."""


def draw_state(frame: Frame | None) -> None:
    """Mode, queue, samples, speed, device."""
    if frame is None:
        imgui.text_disabled("No picture yet")
        return
    picture = frame.pictures[-1]
    _draw_progress(picture, _resting_text(frame))
    least, mean = int(picture.tile_spp.min()), float(picture.tile_spp.mean())
    widgets.value_row("Samples", f"{least:,} least, {mean:,.1f} mean", "Per pixel")
    height, width = picture.image.shape[:2]
    widgets.value_row("Size", f"{width} × {height}" + (" (preview)" if frame.is_preview else ""))
    widgets.value_row("Textures", described_textures(frame.view.scene), "Each image is there once")
    widgets.value_row("Speed", f"{frame.paths_per_second / 1e6:.2f} million paths/s")
    widgets.value_row("Step", f"{frame.step_seconds * 1e3:.1f} ms")
    if frame.nonfinite:
        widgets.value_row("Not finite", f"{frame.nonfinite:,} samples", "They count as black")
    if frame.cut_off > CUT_OFF_WORTH_TELLING:
        widgets.value_row("Ended in glass", f"{100 * frame.cut_off:.1f} % of the paths", _CUT_OFF_TIP)


def found_text(picture: Picture) -> str | None:
    """How much of an edit is found; None where that is not measured, or nothing is left to find."""
    left = picture.error_left
    return f"Change found: {_percent_found(left)} %" if left else None


def _percent_found(left: float) -> int:
    # All is found when nothing is left, not when little is.
    return math.floor(100 * (1 - left))


def _resting_text(frame: Frame) -> str | None:
    if not frame.resting:
        return None
    return "Paused" if frame.view.paused else "At rest: the target is reached"


def _draw_progress(picture: Picture, resting: str | None) -> None:
    left = picture.error_left
    imgui.text_unformatted(resting or (_FINDING_TEXT if left else MODE_TEXTS[picture.mode]))
    places.note("mode")
    if left:
        share, text = 1 - left, f"{_percent_found(left)} % of the change found"
    else:
        done, total = picture.queue_done, len(picture.queue)
        share, text = done / max(total, 1), f"{done:,} of {total:,} tiles"
    imgui.progress_bar(share, imgui.ImVec2(-1, 0), text)
    places.note("queue")
    if left:
        imgui.set_item_tooltip(_FOUND_TIP)


def draw_device(devices: Sequence[str], current: str) -> str | None:
    """The device that renders; another one where the user chose it."""
    chosen = widgets.choice("Device", current, [(name, name) for name in devices], "OpenCL device")
    return chosen if chosen != current else None


def draw_control(
    control: Control, preferences: Preferences, uses_nor: bool, refusals: Refusals
) -> tuple[Control, Preferences, bool]:
    """Pause, target, resolution; returns both values after this frame, and whether to restart. `uses_nor`:
    whether repetitions mean anything to the strategy."""
    with widgets.row("Rendering"):
        paused = control.paused
        if widgets.button("Go on" if paused else "Pause"):
            paused = not paused
        widgets.same_line()
        is_restart = widgets.button("Restart")
    target = widgets.whole_number(
        "Target spp", control.target_spp or 0, low=0, high=1 << 20, speed=1.0,
        tip="Rest when every pixel has that many samples; 0: never",
    )  # fmt: skip
    percent = preferences.resolution_scale * 100
    new_percent = widgets.number(
        "Resolution", percent, low=5.0, high=400.0, speed=1.0, unit=" %", decimals=0,
        tip="Of the scene's own size",
    )  # fmt: skip
    step_ms = widgets.number(
        "Step time", preferences.step_ms, low=5.0, high=500.0, speed=0.5, unit=" ms", decimals=0,
        tip="A rendering step aims at this time; shorter answers sooner, longer is more efficient",
    )  # fmt: skip
    drag_nor = widgets.whole_number(
        "NoR in a drag", preferences.drag_nor, low=1, high=1 << 16,
        tip="Repetitions of a tile while something is dragged; the full NoR starts when it is let go",
        enabled=uses_nor, why_not=_WITHOUT_NOR,
    )  # fmt: skip
    # A percentage that was not touched stays to the bit, which multiplying and dividing would round.
    scale = preferences.resolution_scale if new_percent == percent else new_percent / 100
    control = replace(control, paused=paused, target_spp=target or None)
    preferences = refusals.changed(preferences, resolution_scale=scale, step_ms=step_ms, drag_nor=drag_nor)
    return control, preferences, is_restart


def draw_settings(settings: RenderSettings, refusals: Refusals) -> RenderSettings:
    """The scene's render settings; returns them after this frame."""
    strategies = [(name, STRATEGY_TEXTS.get(name, name)) for name in STRATEGIES]
    strategy = widgets.choice("Strategy", settings.strategy, strategies, _STRATEGY_TIP)
    settings = refusals.changed(settings, strategy=strategy)
    sizes = [(str(size), f"{size} × {size}") for size in sorted({*_TILE_SIZES, settings.tile_size})]
    tile_size = int(widgets.choice("Tile size", str(settings.tile_size), sizes, "Pixels"))
    settings = refusals.changed(settings, tile_size=tile_size)
    for name, label, low, high, tip in (
        ("nor", "NoR", 1, 1 << 16, "Repetitions of a tile while an edit is rendered"),
        ("base_nor", "Base NoR", 1, 1 << 10, "Repetitions in Base and Refine"),
        ("sample_rate", "Sample rate", 1, 64, "Paths per pixel and slot"),
        ("max_bounces", "Bounces", 0, 200, "Scattering events after the first hit; 0: direct light only"),
        ("transmission_bounces", "Glass bounces", 0, 200, "Passages through smooth dielectrics"),
        ("texture_limit", "Texture limit", 0, 1 << 14, _LIMIT_TIP),
        ("seed", "Seed", 0, (1 << 31) - 1, "Chooses the random numbers"),
    ):
        value = widgets.whole_number(
            label, getattr(settings, name), low=low, high=high, tip=tip,
            enabled=name != "nor" or strategy_of(settings).uses_nor, why_not=_WITHOUT_NOR,
        )  # fmt: skip
        settings = refusals.changed(settings, **{name: value})
        if name == "nor" and strategy_of(settings).uses_nor:
            adapts = widgets.checkbox("NoR adapts", settings.nor_adapts, _ADAPTS_TIP)
            settings = refusals.changed(settings, nor_adapts=adapts)
    clamp = widgets.number("Clamp indirect", settings.clamp_indirect, high=1e6, speed=0.02, tip=_CLAMP_TIP)
    settings = refusals.changed(settings, clamp_indirect=clamp)
    transparent = widgets.checkbox("Transparent", settings.transparent, _TRANSPARENT_TIP)
    settings = refusals.changed(settings, transparent=transparent)
    width = widgets.whole_number("Width", settings.size[0], low=16, high=8192, speed=2.0, tip="Pixels")
    height = widgets.whole_number("Height", settings.size[1], low=16, high=8192, speed=2.0, tip="Pixels")
    return refusals.changed(settings, size=(width, height))
