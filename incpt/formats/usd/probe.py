"""Opens layers in another process first: damaged ones can end the process that opens them.

Crate files hold counts that the library of USD trusts: it takes memory for them, and ends the process
where there is none. What the other process survives is opened in this one.
"""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

from incpt.core.errors import InputError
from incpt.formats.usd.memory import LEAST, TIMES_ITS_SIZE

_CRATE = b"PXR-USDC"
_SECONDS = 120
_PROGRAM = """
import sys
bound = int(sys.argv[1])
if sys.platform != "win32":
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
from pxr import Sdf
for path in sys.argv[2:]:
    try:
        Sdf.Layer.FindOrOpen(path)
    except Exception:  # It is said where it is opened for good.
        pass
"""


def check_opens(files: Sequence[Path]) -> None:
    """Raises InputError where opening one of these files would end the process, or take more memory than such
    files need. Texts are not asked."""
    crates = [file for file in files if _may_be_crate(file)]
    if not crates:
        return
    bound = LEAST + TIMES_ITS_SIZE * sum(file.stat().st_size for file in crates)
    program = [sys.executable, "-c", _PROGRAM, str(bound), *map(str, crates)]
    try:
        ended = subprocess.run(program, capture_output=True, timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(f"takes more than {_SECONDS} seconds to open; it is damaged") from None
    if ended.returncode:
        raise InputError("asks for more than can be in files of its size; it is damaged")


def _may_be_crate(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            return stream.read(len(_CRATE)) == _CRATE or zipfile.is_zipfile(file)
    except OSError:
        return False
