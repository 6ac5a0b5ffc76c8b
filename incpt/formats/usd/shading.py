"""What the input of a shader reads: a value, or an output of another shader, through node graphs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import UsdShade


@dataclass(frozen=True, eq=False)
class Source:
    """The shader that an input reads, with the name of its output."""

    shader: Any
    output: str

    @property
    def kind(self) -> str:
        """Such as UsdUVTexture."""
        return str(self.shader.GetIdAttr().Get() or "")


class Inputs:
    """The inputs of a shader at a moment."""

    def __init__(self, shader: Any, moment: Any) -> None:
        self.shader, self._moment = shader, moment

    def source(self, name: str) -> Source | None:
        """The shader that an input is connected to, if any."""
        attribute = self._producer(name)
        if attribute is None or not UsdShade.Output.IsOutput(attribute):
            return None
        return Source(UsdShade.Shader(attribute.GetPrim()), UsdShade.Output(attribute).GetBaseName())

    def value(self, name: str, default: Any) -> Any:
        """The value of an input, or of the input of a graph that it is connected to."""
        attribute = self._producer(name)
        if attribute is None or UsdShade.Output.IsOutput(attribute):
            return default
        found = attribute.Get(self._moment)
        return default if found is None else found

    def number(self, name: str, default: float) -> float:
        """Raises nothing: what is no number counts as the default."""
        found = self.value(name, default)
        return float(found) if isinstance(found, int | float) else default

    def numbers(self, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """A vector or a colour, as `number`."""
        found = self.value(name, default)
        try:
            values = tuple(float(one) for one in found)
        except (TypeError, ValueError):
            return default
        return values if len(values) == len(default) else default

    def text(self, name: str, default: str) -> str:
        """A token or a text."""
        return str(self.value(name, default))

    def _producer(self, name: str) -> Any:
        found = self.shader.GetInput(name)
        if not found:
            return None
        attributes = UsdShade.Utils.GetValueProducingAttributes(found)
        return attributes[0] if attributes else None
