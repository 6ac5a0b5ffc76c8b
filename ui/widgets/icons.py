"""Signs that stand for words: glyphs of Font Awesome 4, which `theme.load_font` adds to the text font."""

from __future__ import annotations

FILE = "fontawesome-webfont.ttf"
"""The font, in imgui-bundle's folder of fonts (SIL Open Font License 1.1)."""

EYE, EYE_SLASH = "\uf06e", "\uf070"
"""Shown, and hidden."""
CUBE, LIGHTBULB = "\uf1b2", "\uf0eb"
"""An object, and a light."""
WARNING = "\uf071"
"""Something is missing."""
COPY = "\uf0c5"
"""To the clipboard."""
