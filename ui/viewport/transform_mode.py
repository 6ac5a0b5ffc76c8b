"""A transform of the selection that keys and mouse steer in the picture: `modal_transform` with a window."""

from __future__ import annotations

from incpt.scene.model import Scene
from incpt.ui.editor.state import Beginning
from incpt.ui.preferences import SnapSettings
from incpt.ui.rect import Rect
from incpt.ui.viewport import modal_input, modal_marks, modal_transform
from incpt.ui.viewport.modal_input import Ending
from incpt.ui.viewport.modal_transform import ModalTransform


class TransformMode:
    """At most one transform. `is_on` tells whether one is under way, `label` how the history calls it."""

    def __init__(self) -> None:
        self.label = ""
        self._now: ModalTransform | None = None
        self._left: Scene | None = None
        """The scene as the last frame left it."""

    @property
    def is_on(self) -> bool:
        return self._now is not None

    def begin(
        self,
        beginning: Beginning,
        scene: Scene,
        names: tuple[str, ...],
        snap: SnapSettings,
        picture: Rect[float],
        about: str = "median",
    ) -> None:
        """Begin one of the named objects that are shown; the picture lies at `picture`, in points. `about`:
        see `Tool.pivot`."""
        self.label, self._left = beginning.label, scene
        self._now = modal_transform.begun(
            scene, names, beginning.action, modal_input.mouse(picture.middle), snap, picture, about
        )

    def update(
        self,
        scene: Scene,
        is_snapping: bool,
        picture: Rect[float],
        *,
        is_blocked: bool = False,
        is_split: bool = False,
    ) -> Scene:
        """Take a frame's mouse and keys and draw the marks; returns the scene after it. A scene that is not
        the one that it left ends it, because somebody else made that; a dialog (`is_blocked`) gives it up."""
        now = self._now
        if now is None or scene is not self._left:
            self._now = None
            return scene
        ending = Ending.GIVEN_UP if is_blocked else modal_input.ending()
        if ending is Ending.GIVEN_UP:
            self._now = None
            return now.start.scene
        now = now.after(modal_input.transform_input(now.mouse, is_snapping))
        self._now = None if ending is Ending.CONFIRMED else now
        if self._now is not None:
            modal_marks.draw(now, picture, is_split)
        # A scene that is equal, as of a mouse that moves while a number counts, is nothing new to anybody.
        if now.scene != scene:
            self._left = now.scene
        return self._left

    def stop(self) -> None:
        """End it, whatever the scene is."""
        self._now = None
