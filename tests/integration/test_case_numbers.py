"""A case is its number: the same again, alone, in any order; and what is changed is never what was given."""

from copy import deepcopy
from pathlib import Path

import psutil
import pytest

from tests.tools.fuzz.byte_changes import changed_bytes
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.fuzzing import fuzz
from tests.tools.fuzz.target import ByteTarget, MsgpackTarget
from tests.tools.fuzz.tree_changes import changed_tree
from tests.tools.fuzz.trial import MOST_MB, peak_mb, tried

TREE = {"v": 2, "arrays": {"pose": ["<f8", [2, 3], bytes(48)]}, "names": ["a", "b"], "rate_hz": 10.0, "on": True}


class Doors(ByteTarget):
    """A door with every fault that a door may have."""

    name = "doors"
    limit_s = 0.5  # whatever pages cost on a busy machine

    def make_samples(self) -> list[bytes]:
        self.kept = bytearray()
        return [b"abc"]

    def case(self, dice: Dice) -> bytes:
        return dice.pick((b"fine", b"raises", b"hangs", b"grows", b"panics"))

    def door(self, case: bytes) -> None:
        if case == b"raises":
            raise KeyError("flock")
        if case == b"panics":
            raise BaseException("native code")
        while case == b"hangs":
            try:
                len(case)
            except Exception:  # noqa: BLE001 - a door that swallows all errors must not swallow its time limit
                continue
        if case == b"grows":
            self.kept = bytearray()
            below_peak_mb = peak_mb() - (psutil.Process().memory_info().rss >> 20)
            self.kept = bytearray(b"x") * ((below_peak_mb + MOST_MB + 50) << 20)


class Packed(MsgpackTarget):
    name = "packed"

    def make_samples(self) -> list[bytes]:
        return [self.pack(TREE)]

    def door(self, case: bytes) -> None:
        self.unpack(case)


@pytest.mark.parametrize(
    ("case", "found"),
    [(b"raises", "KeyError: 'flock'"), (b"panics", "BaseException"), (b"hangs", "over 0.5 s"), (b"grows", "MB at its")],
)
def test_whatever_a_door_does_but_refuse_by_name_is_found(tmp_path: Path, case: bytes, found: str) -> None:
    assert found in tried(Doors(tmp_path), case)[1]


def test_what_was_found_tells_how_to_run_it_again(tmp_path: Path) -> None:
    report = fuzz(Doors(tmp_path), 7, range(8), 8)
    first = next(finding for finding in report.findings if "KeyError" in finding.what)
    assert f"python -m tests.tools.fuzz doors --seed 7 --only {first.number}" in str(first)
    assert Doors(tmp_path).case(Dice(7, "doors", first.number)) == b"raises"


def test_a_case_is_the_same_whatever_was_tried_before(tmp_path: Path) -> None:
    target = Packed(tmp_path)
    forth = [target.case(Dice(1, "packed", number)) for number in range(200)]
    back = [target.case(Dice(1, "packed", number)) for number in reversed(range(200))]
    assert forth == back[::-1]
    assert len(set(forth)) > 150
    assert forth != [target.case(Dice(2, "packed", number)) for number in range(200)]


def test_changes_leave_what_they_were_given_as_it_was() -> None:
    tree, data = deepcopy(TREE), b"0123456789" * 9
    for number in range(500):
        dice = Dice(1, "changes", number)
        changed_tree(dice, tree, [tree, {"more": [1]}])
        changed_bytes(dice, data, [data, b"other"])
    assert tree == TREE
    assert data == b"0123456789" * 9


def test_every_kind_of_change_comes() -> None:
    changed = [changed_tree(Dice(1, "kinds", number), TREE, [TREE]) for number in range(3000)]
    assert any(not isinstance(tree, dict) for tree in changed)
    tables = [tree for tree in changed if isinstance(tree, dict)]
    for wanted in ("v", "arrays", "names", "rate_hz", "on"):
        assert any(wanted not in tree for tree in tables), wanted
    assert any(tree.get("rate_hz") != tree.get("rate_hz") for tree in tables), "a number that is none"
    assert any(len(tree.get("names") or ()) > 100 for tree in tables if isinstance(tree.get("names"), list))
