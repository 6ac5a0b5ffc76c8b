"""The public names of `incpt`, from signatures and docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cached_property
from typing import Any

import incpt

_PLAIN = (bool, int, float, str, type(None))
_LONGEST = 100
"""Characters of a line, beyond which each argument stands on one of its own."""


def names() -> str:
    """Each name with its signature, its docstring, and the methods of a class."""
    return "\n\n".join(
        _described(name, getattr(incpt, name)) for name in sorted(incpt.__all__, key=str.lower)
    )


def _described(name: str, value: Any) -> str:
    lines = [f"### {name}", f"From `incpt.{incpt._HOMES[name]}`."]
    if inspect.isclass(value):
        if issubclass(value, Enum):
            lines.append(", ".join(f"`{member}`" for member in value))
        head = "" if _is_never_called(value) else _signature(name, value) + "\n\n"
        lines.append(_block(head + inspect.cleandoc(value.__doc__ or "")))
        members = [f"{head}\n{_indented(text)}" if text else head for head, text in _members(value)]
        lines += [_block("\n\n".join(members))] if members else []
    else:
        lines.append(_block(f"{_signature(name, value)}\n{_indented(inspect.cleandoc(value.__doc__))}"))
    return "\n\n".join(lines)


def _is_never_called(value: type) -> bool:
    """Whether the class is an enumeration or an exception."""
    return issubclass(value, (Enum, BaseException))


def _members(value: type) -> Iterator[tuple[str, str]]:
    """Head and docstring of each public method and property that the class itself defines."""
    for name, member in vars(value).items():
        if name.startswith("_"):
            continue
        text = inspect.getdoc(member) or ""
        if isinstance(member, property | cached_property):
            function: Any = member.fget if isinstance(member, property) else member.func
            yield f"{name}: {inspect.signature(function).return_annotation}", text
        elif isinstance(member, classmethod | staticmethod):
            yield _signature(f"{value.__name__}.{name}", getattr(value, name)), text
        elif inspect.isfunction(member):
            yield _signature(name, member, is_method=True), text


def _signature(name: str, function: Any, is_method: bool = False) -> str:
    """As a reader of Python expects it; defaults that are no plain values are left out."""
    signature = inspect.signature(function)
    parameters = list(signature.parameters.values())[1 if is_method else 0 :]
    words = list(_words(parameters))
    result = signature.return_annotation
    is_told = result is not inspect.Signature.empty and not inspect.isclass(function)
    end = f" -> {result}" if is_told and isinstance(result, str) else ""
    line = f"{name}({', '.join(words)}){end}"
    if len(line) <= _LONGEST:
        return line
    return f"{name}(\n" + "".join(f"    {word},\n" for word in words) + f"){end}"


def _words(parameters: list[inspect.Parameter]) -> Iterator[str]:
    kinds = [one.kind for one in parameters]
    for index, one in enumerate(parameters):
        if one.kind is one.KEYWORD_ONLY and not {one.kind, one.VAR_POSITIONAL} & {*kinds[:index]}:
            yield "*"
        star = "*" if one.kind is one.VAR_POSITIONAL else "**" if one.kind is one.VAR_KEYWORD else ""
        default = "" if one.default is one.empty else f" = {_default(one.default)}"
        yield f"{star}{one.name}: {one.annotation}{default}"
        is_last = index + 1 == len(parameters) or kinds[index + 1] is not one.POSITIONAL_ONLY
        if one.kind is one.POSITIONAL_ONLY and is_last:
            yield "/"


def _default(value: Any) -> str:
    is_plain = isinstance(value, _PLAIN) or (
        isinstance(value, tuple) and all(isinstance(one, _PLAIN) for one in value)
    )
    return repr(value) if is_plain else "…"


def _indented(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.splitlines())


def _block(text: str) -> str:
    return f"```text\n{text}\n```"


PIECES: dict[str, Callable[[], str]] = {"public names": names}
