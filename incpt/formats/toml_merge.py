"""Writes the tables of a scene file over an earlier text, of which comments, order and spelling stay.

The earlier text is taken apart into blocks, one for each header with the comments right above it. A block
whose values are the same is copied as it is; in others tomlkit changes the values that differ. What comes out
is read again: where it does not hold the very tables that were asked for, there is no merged text.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from typing import Any

Path = tuple[str, ...]
Defaults = Callable[[Path, Mapping[str, Any]], Mapping[str, Any]]
"""The values that keys of the table at a path have where they are missing."""

_HEADER = re.compile(r"\s*\[.*\]\s*(#.*)?$")
"""What may be the header of a table; a line of a long array may look like that too."""
_TABLES_OF_TABLES = ("materials", "cameras")
"""Tables that hold further ones by name."""


@dataclass(frozen=True)
class _Block:
    """A header with the comments right above it (`lead`) and what follows it, as text; `path` and `table` are
    what it says. The first block has no header."""

    lead: str
    header: str
    body: str
    path: Path = ()
    is_array: bool = False
    table: Mapping[str, Any] | None = None

    @property
    def text(self) -> str:
        return self.lead + self.header + self.body


def merged(template: str, tables: Mapping[str, Any], defaults: Defaults) -> str | None:
    """`tables` as TOML, in the words of `template`. A value that is missing in one of both counts as its
    default. None: the template has a form that is not known here."""
    try:
        blocks = [_read(block) for block in _blocks(template)]
        wanted = _worded_alike(tables, {block.path for block in blocks})
        kept, missing = _kept(blocks, wanted, defaults)
        text = "".join(block.text for block in _completed(kept, missing))
        found = tomllib.loads(text)
    except Exception:  # tomlkit raises errors of many types, and the scene is to be saved all the same.
        return None
    return text if _with_defaults(found, defaults) == _with_defaults(wanted, defaults) else None


# ------------------------------------------------------------------------------------------ taking apart


def _blocks(text: str) -> Iterator[_Block]:
    header, lead = "", ""
    lines: list[str] = []
    for line in text.splitlines(keepends=True):
        if _HEADER.match(line.rstrip("\r\n")) and _is_whole(header + "".join(lines)):
            body, following = _split_lead(lines) if header or _has_keys(lines) else (lines, [])
            yield _Block(lead, header, "".join(body))
            header, lines, lead = line, [], "".join(following)
        else:
            lines.append(line)
    end = "" if not lines or lines[-1].endswith("\n") else "\n"
    yield _Block(lead, header if header.endswith("\n") or not header else header + "\n", "".join(lines) + end)


def _is_whole(text: str) -> bool:
    """Whether a text ends outside of arrays and strings."""
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True


def _has_keys(lines: Sequence[str]) -> bool:
    return any(not _is_remark(line) for line in lines)


def _is_remark(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _split_lead(lines: list[str]) -> tuple[list[str], list[str]]:
    """What belongs to a block, and the comments right above the next header, which belong to that."""
    end = len(lines)
    while end > 0 and lines[end - 1].lstrip().startswith("#"):
        end -= 1
    return lines[:end], lines[end:]


def _read(block: _Block) -> _Block:
    """A block with what it says."""
    value: Any = tomllib.loads(block.header + block.body)
    path: list[str] = []
    place: Any = tomllib.loads(block.header)
    while isinstance(place, dict) and place:
        ((key, place),) = place.items()
        path.append(key)
        value = value[key]
    if isinstance(place, list):
        return replace(block, path=tuple(path), is_array=True, table=value[0])
    return replace(block, path=tuple(path), table=value)


# ---------------------------------------------------------------------------------------- putting together


def _worded_alike(tables: Mapping[str, Any], paths: set[Path]) -> dict[str, Any]:
    """The same tables where there is a choice as in a text with blocks at `paths`."""
    found = {**tables, "render": tables.get("render", {})}
    cameras = dict(tables.get("cameras", {}))
    if ("camera",) in paths and "camera" in cameras:
        found |= {"camera": cameras.pop("camera"), "cameras": cameras}
    return found


def _kept(
    blocks: Sequence[_Block], wanted: Mapping[str, Any], defaults: Defaults
) -> tuple[list[tuple[_Block, int]], list[tuple[_Block, int]]]:
    """The blocks that stay, with the values that are wanted, and those that have to be made; both with their
    place in their array of tables (0 for others)."""
    paths = {block.path for block in blocks if not block.is_array}
    kept: list[tuple[_Block, int]] = []
    partners = {name: _partners(blocks, name, rows) for name, rows in _arrays(wanted).items()}
    for number, block in enumerate(blocks):
        if block.is_array:
            (name,) = block.path
            index = partners.get(name, {}).get(number)
            if index is not None:
                kept.append((_changed(block, wanted[name][index], (), defaults), index))
            continue
        table = _at(wanted, block.path)
        if isinstance(table, dict):
            elsewhere = [key for key in table if _is_block((*block.path, key), table[key], block, paths)]
            kept.append((_changed(block, table, elsewhere, defaults), 0))
    present = {block.path for block, _ in kept if not block.is_array}
    inner = {(*block.path, key) for block in blocks if not block.is_array for key in block.table or {}}
    missing = [
        (_new(path, table), 0)
        for path, table in _tables(wanted)
        if path not in present and path not in inner and path[:1] not in inner
        # A single table that says nothing new need not be there; one of several by name does.
        if path[0] in _TABLES_OF_TABLES or _shortened(path[0], table, defaults)
    ]
    for name, rows in _arrays(wanted).items():
        if (name,) not in inner:
            found = set(partners[name].values())
            missing += [
                (_new((name,), row, is_array=True), i) for i, row in enumerate(rows) if i not in found
            ]
    return kept, missing


def _is_block(path: Path, value: Any, block: _Block, paths: set[Path]) -> bool:
    """Whether a value stands in a block of its own, and not among the keys of `block`."""
    if path in paths and isinstance(value, dict):
        return True
    if path[-1] in (block.table or {}):
        return False
    is_table = isinstance(value, dict) and (
        len(path) == 1 or (len(path) == 2 and (path[0] in _TABLES_OF_TABLES or path[1] == "sky"))
    )
    return is_table or (len(path) == 1 and _is_rows(value))


def _completed(kept: list[tuple[_Block, int]], missing: list[tuple[_Block, int]]) -> list[_Block]:
    """All blocks: new ones behind the last of their kind, rows of an array in their order."""
    found = list(kept)
    for block, index in missing:
        same = [i for i, (other, _) in enumerate(found) if other.path[:1] == block.path[:1]]
        if block.is_array:
            same = [i for i in same if found[i][1] < index]
        at = same[-1] + 1 if same else len(found)
        needs_line = at > 0 and not found[at - 1][0].text.endswith("\n\n")
        found.insert(at, (replace(block, lead="\n") if needs_line else block, index))
    for name in {block.path for block, _ in found if block.is_array}:
        slots = [i for i, (block, _) in enumerate(found) if block.is_array and block.path == name]
        rows = sorted((found[i] for i in slots), key=lambda row: row[1])
        for slot, row in zip(slots, rows, strict=True):
            found[slot] = row
    return [block for block, _ in found]


def _partners(blocks: Sequence[_Block], name: str, rows: Sequence[Mapping[str, Any]]) -> dict[int, int]:
    """For each block of an array of tables (by its number) the row that it becomes: that of its name, or
    where as many others stand between the same neighbours, the one in its place, which was renamed."""
    numbers = [i for i, block in enumerate(blocks) if block.is_array and block.path == (name,)]
    old = [str((blocks[i].table or {}).get("name")) for i in numbers]
    new = [str(row.get("name")) for row in rows]
    rows_by_name = {name: row for row, name in enumerate(new)}
    partners = {n: rows_by_name[name] for n, name in zip(numbers, old, strict=True) if name in rows_by_name}
    taken = set(partners.values())
    for tag, first, last, start, end in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        before = [i for i in range(first, last) if numbers[i] not in partners]
        after = [row for row in range(start, end) if row not in taken]
        if tag == "replace" and len(before) == len(after):
            partners.update(zip((numbers[i] for i in before), after, strict=True))
        for i in before if tag == "replace" and len(before) != len(after) else ():
            # A row whose mesh file holds several meshes has become several: "name/part".
            parts = [row for row in after if new[row].startswith(f"{old[i]}/")]
            partners.update({numbers[i]: parts[0]} if parts else {})
    return partners


def _changed(block: _Block, table: Mapping[str, Any], elsewhere: Sequence[str], defaults: Defaults) -> _Block:
    """A block with the values of `table`, but for the keys that stand `elsewhere`."""
    own, usual = block.table or {}, defaults(block.path, table)
    gone = [k for k in own if k not in table and not (k in usual and usual[k] == own[k])]
    changed = {
        key: value
        for key, value in table.items()
        if key not in elsewhere and not _is_said(block.path, own, key, value, usual, defaults)
    }
    if not gone and not changed:
        return block
    import tomlkit

    lines = block.body.splitlines(keepends=True)
    end = len(lines)
    while end > 0 and _is_remark(lines[end - 1]):
        end -= 1
    keys = tomlkit.parse("".join(lines[:end]))
    for key in gone:
        del keys[key]
    for key, value in changed.items():
        keys[key] = _item(_shortened(key, value, defaults) if not block.path else value)
    return replace(block, body=tomlkit.dumps(keys) + "".join(lines[end:]))


def _shortened(name: str, value: Any, defaults: Defaults) -> Any:
    """A table, or the rows of an array of them, without the keys that say what holds anyway."""
    if _is_rows(value):
        return [_shortened(name, row, defaults) for row in value]
    if not isinstance(value, dict) or name in _TABLES_OF_TABLES:
        return value
    usual = defaults((name,), value)
    return {key: one for key, one in value.items() if not (key in usual and usual[key] == one)}


def _is_said(
    path: Path,
    own: Mapping[str, Any],
    key: str,
    value: Any,
    usual: Mapping[str, Any],
    defaults: Defaults,
) -> bool:
    """Whether a block says a value already, or need not."""
    if key not in own:
        return key in usual and bool(usual[key] == value)
    if path and path[0] not in _TABLES_OF_TABLES or len(path) > 1:
        return bool(own[key] == value)
    # Above all headers, and in a table of tables, whole tables may stand on one line.
    old, new = ({path[0]: {key: one}} if path else {key: one} for one in (own[key], value))
    return _with_defaults(old, defaults) == _with_defaults(new, defaults)


def _new(path: Path, table: Mapping[str, Any], is_array: bool = False) -> _Block:
    import tomlkit

    keys = tomlkit.document()
    for key, value in table.items():
        if not (path == ("environment",) and key == "sky"):
            keys[key] = _item(value)
    name = ".".join(tomlkit.key([part]).as_string() for part in path)
    header = f"[[{name}]]\n" if is_array else f"[{name}]\n"
    return _Block("", header, tomlkit.dumps(keys), path, is_array, table)


def _item(value: Any) -> Any:
    """A value as tomlkit writes it on one line."""
    import tomlkit

    if isinstance(value, dict):
        item = tomlkit.inline_table()
        item.update({key: _item(one) for key, one in value.items()})
        return item
    if isinstance(value, list):
        array = tomlkit.array()
        array.extend([_item(one) for one in value])
        return array.multiline(_is_rows(value))
    return value


# ----------------------------------------------------------------------------------------------- tables


def _at(tables: Mapping[str, Any], path: Path) -> Any:
    found: Any = tables
    for key in path:
        found = found.get(key) if isinstance(found, dict) else None
    return found


def _is_rows(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, dict) for row in value)


def _arrays(tables: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    return {name: value for name, value in tables.items() if _is_rows(value)}


def _tables(tables: Mapping[str, Any]) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """The tables that usually have a block of their own, with their paths."""
    for name, value in tables.items():
        if not isinstance(value, dict):
            continue
        if name in _TABLES_OF_TABLES:
            yield from (((name, part), table) for part, table in value.items())
            continue
        yield (name,), value
        if "sky" in value:
            yield (name, "sky"), value["sky"]


def _with_defaults(tables: Mapping[str, Any], defaults: Defaults) -> dict[str, Any]:
    """All tables with the values that keys have where they are missing, to be compared."""
    full: dict[str, Any] = {}
    for name, value in tables.items():
        if name in _TABLES_OF_TABLES and isinstance(value, dict):
            full[name] = {part: {**defaults((name, part), t), **t} for part, t in value.items()}
        elif _is_rows(value):
            full[name] = [{**defaults((name,), row), **row} for row in value]
        elif isinstance(value, dict):
            full[name] = {**defaults((name,), value), **value}
            if "sky" in value:
                full[name]["sky"] = {**defaults((name, "sky"), value["sky"]), **value["sky"]}
        else:
            full[name] = value
    return {name: value for name, value in full.items() if value != defaults((name,), {})}
