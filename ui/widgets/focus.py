"""Which field has the keyboard.

A field keeps it only while somebody sees that it is typed into: keys that went into a field that was left,
or that is out of sight, would be commands that are lost.
"""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.widgets import places

_TAB_OWNER = 0x7AB
"""A number for imgui that no widget has."""
_BUTTONS_OF_PICTURE = (imgui.MouseButton_.right, imgui.MouseButton_.middle)
"""Buttons by whose press imgui itself ends no typing."""
_is_typing = [False]
"""Whether the keys of this frame go to a field; a list of one, so that functions can set it."""
_has_edited = [False]
"""Whether the text of that field was changed since it was opened."""


def begin_frame() -> None:
    """End the typing where it was left, and keep Tab from opening a field where none is typed into."""
    typed = _typed_field()
    if typed and (_is_pressed_elsewhere(typed) or places.is_active_hidden()):
        imgui.internal.clear_active_id()
        typed = 0
    _is_typing[0] = typed != 0
    _has_edited[0] = typed != 0 and imgui.get_current_context().input_text_state.edited_before
    if not typed and not imgui.is_key_down(imgui.Key.tab):
        # imgui goes to the next field by a Tab that nobody owns, wherever one was typed into last.
        imgui.internal.set_key_owner(imgui.Key.tab, _TAB_OWNER)


def is_typing() -> bool:
    """Whether the keys of this frame go to a field, the one that ends the typing among them."""
    return _is_typing[0]


def has_typed() -> bool:
    """For a field that is left in this frame: whether a text was typed, and not given up by Escape."""
    return _has_edited[0] and not imgui.is_key_pressed(imgui.Key.escape, False)


def _typed_field() -> int:
    """imgui's number of the field that is typed into; 0: none is."""
    context = imgui.get_current_context()
    active = int(context.active_id)
    # The state of the text outlives the typing, and a number that is dragged has the same one.
    is_typed = imgui.get_io().want_text_input and active == context.input_text_state.id_
    return active if is_typed else 0


def _is_pressed_elsewhere(field: int) -> bool:
    if imgui.get_current_context().hovered_id_previous_frame == field:
        return False
    return any(imgui.is_mouse_clicked(button) for button in _BUTTONS_OF_PICTURE)
