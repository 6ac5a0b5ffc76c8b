"""OBJ: rewrites files that trimesh cannot read as they are."""

from __future__ import annotations

import re

ODD_FACE = re.compile(rb"^[ \t]*f[^\n\\]*[\s/](?:-|0+(?:[\s/]|$))", re.MULTILINE)
"""A face line with an index that is negative or zero."""
_OBJ_ROWS = {b"v": 0, b"vt": 1, b"vn": 2}


def utf8(content: bytes) -> bytes:
    """The same text as UTF-8. That of older programs is Latin-1, for which trimesh would need another
    library."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def absolute_obj(content: bytes) -> tuple[bytes, int]:
    """The same file with triangles only and with indices counted from 1, and how many faces were left out
    because they use a vertex that is not there. Raises ValueError for an index that is no number."""
    lines = [
        (line, line.split(b"#")[0].split())
        for line in content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    ]
    totals = [sum(words[:1] == [key] for _, words in lines) for key in _OBJ_ROWS]
    counts = [0, 0, 0]
    written: list[bytes] = []
    left_out = 0
    for line, words in lines:
        if words[:1] == [b"f"]:
            corners = [_obj_corner(word, counts, totals) for word in words[1:]]
            if len(corners) < 3 or b"" in corners:
                left_out += 1
                continue
            written += [
                b" ".join((b"f", corners[0], *corners[i : i + 2])) for i in range(1, len(corners) - 1)
            ]
            continue
        if words and words[0] in _OBJ_ROWS:
            counts[_OBJ_ROWS[words[0]]] += 1
        written.append(line)
    return b"\n".join(written), left_out


def _obj_corner(word: bytes, counts: list[int], totals: list[int]) -> bytes:
    """`vertex` or `vertex//normal`, counted from 1; nothing where the vertex is not there."""
    fields = word.split(b"/")
    absolute = []
    for row in (0, 2):
        index = int(fields[row]) if len(fields) > row and fields[row] else 0
        index += counts[row] + 1 if index < 0 else 0
        absolute.append(index if 1 <= index <= totals[row] else None)
    vertex, normal = absolute
    if vertex is None:
        return b""
    return b"%d" % vertex if normal is None else b"%d//%d" % (vertex, normal)
