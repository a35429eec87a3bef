"""Enumerations whose members say what they mean."""

from enum import IntEnum
from typing import Self


class Explained(IntEnum):
    """Integers, each with its meaning: `NAME = 0, "what it means"`."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Self:
        """The member of this number."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member
