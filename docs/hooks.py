"""What mkdocs needs beside the pages: the pictures, and the documents of the repository that pages link to.

Pages link to them relative to the repository, so that links hold where it is read as files. The site has them
below `repository/`, under the same paths, and links are led there.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
BELOW = "repository/"
"""Where the site has what lies outside of docs/."""
OUTSIDE = (
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "benchmarks/README.md",
    "benchmarks/SPEED.md",
    "incpt/render/impact/README.md",
    "scenes/LICENSES.md",
    "scenes/README.md",
    "scenes/pictures/*.png",
)
_LINK = re.compile(r"(\]\()\.\./(?=[\w.])")


def on_files(files: Files, config: Any) -> Files:
    """Adds what lies outside of docs/."""
    for pattern in OUTSIDE:
        for path in sorted(ROOT.glob(pattern)):
            name = BELOW + path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Leads links out of docs/ to what `on_files` has added."""
    return markdown if page.file.src_uri.startswith(BELOW) else _LINK.sub(rf"\1{BELOW}", markdown)
