"""A picture on the system's clipboard, which GLFW cannot reach: by the tool that each system has for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from incpt.core.errors import OutputError

_SECONDS = 5.0
"""How long the system's tool may take."""


def copy_picture(pixels: npt.NDArray[np.uint8]) -> None:
    """Put sRGB `pixels` (H, W, 3), or (H, W, 4) with alpha, on the clipboard as PNG. Raises OutputError that
    says what is missing."""
    folder = Path(tempfile.mkdtemp(prefix="incpt-"))
    path = folder / "picture.png"
    try:
        Image.fromarray(pixels).save(path)
        command = _command(path)
        with path.open("rb") as picture:
            # xclip stays in the background as long as it owns the clipboard: nothing may wait for its output.
            subprocess.run(
                command, stdin=picture, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                check=True, timeout=_SECONDS,
            )  # fmt: skip
    except (OSError, subprocess.SubprocessError) as error:
        raise OutputError(f"the clipboard does not take the picture ({error}); export it instead") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _command(path: Path) -> list[str]:
    if sys.platform == "darwin":
        return ["osascript", "-e", f'set the clipboard to (read (POSIX file "{path}") as «class PNGf»)']
    if sys.platform == "win32":
        load = "Add-Type -AssemblyName System.Windows.Forms,System.Drawing;"
        image = f"[System.Drawing.Image]::FromFile('{path}')"
        return ["powershell", "-NoProfile", "-STA", "-Command",
                f"{load}[System.Windows.Forms.Clipboard]::SetImage({image})"]  # fmt: skip
    tools = (
        ("wl-copy", ["wl-copy", "--type", "image/png"], "WAYLAND_DISPLAY"),
        ("xclip", ["xclip", "-selection", "clipboard", "-t", "image/png", "-i"], "DISPLAY"),
    )
    for name, command, variable in tools:
        if os.environ.get(variable) and shutil.which(name):
            return command
    raise OutputError(
        "the clipboard needs a tool that is not here; install xclip (X11) or wl-clipboard (Wayland)"
    )
