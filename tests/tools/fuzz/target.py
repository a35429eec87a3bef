"""What is fuzzed: a door, samples of what rightly goes through it, and the refusals that it may answer with."""

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import msgpack

from swarmwire.comms.errors import BadFrame, BadInput
from tests.tools.fuzz.byte_changes import changed_bytes
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.tree_changes import changed_tree

ACCEPTED = "accepted"
MOST_LETTERS = 2000  # of a refusal: it is for people


class Target(ABC):
    """One door. A case is what is handed in; samples are cases that must be accepted.

    Attributes:
        name: as the command line has it.
        refusals: errors by which the door refuses; any other, and any warning, is a finding.
        quick: cases in the quick tests.
        limit_s: of processor time for a case.
    """

    name: ClassVar[str]
    refusals: ClassVar[tuple[type[Exception], ...]] = (BadFrame,)
    quick: ClassVar[int] = 300
    limit_s: ClassVar[float] = 5.0

    def __init__(self, folder: Path) -> None:
        """`folder` is the target's own, empty."""
        self.folder = folder
        self.samples = self.make_samples()

    @abstractmethod
    def make_samples(self) -> Sequence[Any]:
        """What rightly goes through the door."""

    @abstractmethod
    def case(self, dice: Dice) -> Any:
        """A sample, changed."""

    @abstractmethod
    def door(self, case: Any) -> str | None:
        """Hand a case in: what became of it in a word, or None if it was accepted. Refusals may be raised."""


class ByteTarget(Target):
    """Of bytes, such as a packet."""

    def case(self, dice: Dice) -> bytes:
        """A sample's bytes, changed."""
        return changed_bytes(dice, dice.pick(self.samples), self.samples)


class PackedTarget(Target):
    """Of bytes that hold a tree (msgpack, JSON, TOML): half of the cases change the tree, so that they get further in.

    Attributes:
        trees: of the samples, in their order.
        inner: keys of a tree in whose values most of it is.
    """

    trees: Sequence[Any]
    inner: ClassVar[tuple[str, ...]] = ()

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.trees = [self.unpack(sample) for sample in self.samples]

    @abstractmethod
    def pack(self, tree: Any) -> bytes:
        """The bytes of a tree; ValueError, TypeError or OverflowError if it cannot be told in them."""

    @abstractmethod
    def unpack(self, data: bytes) -> Any:
        """The tree in these bytes."""

    def case(self, dice: Dice) -> bytes:
        """A sample's bytes, or its tree, changed."""
        if dice.chance(0.35):
            return changed_bytes(dice, dice.pick(self.samples), self.samples)
        at = dice.below(len(self.trees))
        try:
            return self.pack(changed_inside(dice, self.trees[at], self.trees, self.inner))
        except (ValueError, TypeError, OverflowError):  # what cannot be told cannot arrive
            return changed_bytes(dice, self.samples[at], self.samples)


def changed_inside(dice: Dice, tree: Any, trees: Sequence[Any], inner: Sequence[str]) -> Any:
    """The tree with something in it changed: mostly what stands at the keys `inner`, if any."""
    some = [key for key in inner if isinstance(tree, dict) and tree.get(key)]
    if some and dice.chance(0.7):
        key = dice.pick(some)
        return {
            **tree,
            key: changed_tree(
                dice, tree[key], [other[key] for other in trees if isinstance(other, dict) and key in other]
            ),
        }
    return changed_tree(dice, tree, trees)


def refusal_name(error: Exception) -> str:
    """Under which name a refusal is counted: its class, and the first words of what was expected."""
    text = error.expected if isinstance(error, BadInput) else str(error)
    words = re.sub(r"'[^']*'|\"[^\"]*\"|\S*[\d/_]\S*", "…", text.splitlines()[0] if text else "").split()
    return " ".join((type(error).__name__, *words[:5]))


def check_line(error: Exception, *must_name: str) -> None:
    """A refusal is one line that names these."""
    text = str(error)
    if "\n" in text or not text.isprintable() or len(text) > MOST_LETTERS:
        raise AssertionError(f"a refusal that is no line for people: {text[:300]!r}")
    for name in must_name:
        if name not in text:
            raise AssertionError(f"a refusal that does not name {name}: {text[:300]!r}")


def check_file_line(error: BadInput) -> None:
    """A refusal of a file is one line that names the file."""
    check_line(error)
    if not error.where:
        raise AssertionError(f"a refusal that names no file: {error}")


class MsgpackTarget(PackedTarget):
    """Of msgpack."""

    def pack(self, tree: Any) -> bytes:
        """As msgpack."""
        return msgpack.packb(tree)

    def unpack(self, data: bytes) -> Any:
        """From msgpack."""
        return msgpack.unpackb(data)


class FrameTarget(MsgpackTarget):
    """Of frames."""

    inner = ("arrays", "arrays", "values")
