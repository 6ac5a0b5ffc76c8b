"""Files that another file names: they stay in its folder, unless the user lets it be."""

from __future__ import annotations

import os
from pathlib import Path

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.formats.import_options import current_options


def check_inside(folder: Path, path: str) -> None:
    """Raises InputError where `path`, relative to a folder or absolute, leads out of it and the options do
    not let it: a file from a stranger could else show what is on the disk. Also where no file can be
    called so."""
    if "\0" in path:
        raise InputError(f"{described(path)} is no name of a file")
    root = os.path.realpath(folder)
    found = os.path.realpath(os.path.join(root, path))
    if not current_options().allow_outside and not Path(found).is_relative_to(root):
        raise InputError(
            f"{described(path)} leads out of the folder of the file; --allow-outside lets it, or "
            "allow_outside=True in Python"
        )
