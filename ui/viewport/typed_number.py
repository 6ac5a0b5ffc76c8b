"""A number that is typed while something is moved: digits, sums, and a minus that turns its sign."""

from __future__ import annotations

from dataclasses import dataclass, replace

CHARACTERS = "0123456789.,+-"
"""What belongs to a number; a comma is a point."""
_LONGEST = 24
"""Characters of a number."""


@dataclass(frozen=True)
class TypedNumber:
    """`text` is a sum such as "1.5+2", `is_negative` whether minus was pressed an odd number of times."""

    text: str = ""
    is_negative: bool = False

    @property
    def is_there(self) -> bool:
        """Whether anything was typed."""
        return bool(self.text) or self.is_negative

    @property
    def value(self) -> float:
        """The sum; what is no number yet counts as 0."""
        total = sum(float(term) for term in self.text.split("+") if term.strip("."))
        return -total if self.is_negative and total else total

    @property
    def shown(self) -> str:
        """As it was typed: "-(1.5+2)"."""
        if not self.is_negative:
            return self.text
        return f"-({self.text})" if "+" in self.text else f"-{self.text}"

    def after(self, character: str) -> TypedNumber:
        """After one more of CHARACTERS; what makes no number is left out."""
        if character == "-":
            return replace(self, is_negative=not self.is_negative)
        character = "." if character == "," else character
        term = self.text.rsplit("+", 1)[-1]
        is_wrong = (character == "+" and not term.strip(".")) or (character == "." and "." in term)
        if is_wrong or len(self.text) >= _LONGEST:
            return self
        return replace(self, text=self.text + character)

    def erased(self) -> TypedNumber:
        """Without its last character; without its sign where that is all."""
        return replace(self, text=self.text[:-1]) if self.text else TypedNumber()
