"""Compiled functions: machine code on disk is used again, but not after a change of what it was made from."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import pytest

from swarmwire.comms.kernels import digest_of, kernel

MADE = """
from swarmwire.comms.kernels import kernel, njit
import {other} as other
from {other} import DEEP, Pair, doubled

SHIFT = 1.0

@njit()
def plain(x):
    return doubled(x) + DEEP + other.FAR + SHIFT

@kernel(from_python=True)
def first(pair):
    return pair.a
"""
OTHER = """
from typing import NamedTuple
from swarmwire.comms.kernels import kernel

DEEP, FAR, FACTOR = 10.0, 100.0, 2.0

class Pair(NamedTuple):
    a: float
    b: float

@kernel()
def doubled(x):
    return FACTOR * x
"""
needs_compiler = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="without the compiler nothing is cached")


class Modules:
    """Two modules of a folder, imported anew each time."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.other = folder, OTHER

    def imported(self):
        (self.folder / "kernels_other.py").write_text(self.other)
        (self.folder / "kernels_made.py").write_text(MADE.format(other="kernels_other"))
        for name in ("kernels_made", "kernels_other"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("kernels_made")


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Modules]:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # files change within the second that bytecode goes by
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "machine-code"))
    yield Modules(tmp_path)
    for name in ("kernels_made", "kernels_other"):
        sys.modules.pop(name, None)


def hits(compiled) -> int:
    return sum(compiled.stats.cache_hits.values())


@needs_compiler
def test_machine_code_is_used_again(modules):
    assert modules.imported().plain(1.0) == 113.0
    again = modules.imported()
    assert again.plain(1.0) == 113.0
    assert hits(again.plain) == 1


@needs_compiler
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("DEEP, FAR, FACTOR = 10.0", "DEEP, FAR, FACTOR = 20.0", 123.0),
        ("100.0, 2.0", "200.0, 2.0", 213.0),
        ("100.0, 2.0", "100.0, 3.0", 114.0),
        ("return FACTOR * x", "return FACTOR * x + 1.0", 114.0),
    ],
    ids=["a constant", "a constant by its module", "a constant of a kernel that is called", "a kernel that is called"],
)
def test_a_change_elsewhere_is_noticed(modules, old, new, expected):
    assert modules.imported().plain(1.0) == 113.0
    modules.other = OTHER.replace(old, new)
    assert modules.imported().plain(1.0) == expected


@needs_compiler
def test_fields_of_a_tuple_in_another_order_are_noticed(modules):
    made = modules.imported()
    assert made.first(made.Pair(a=1.0, b=2.0)) == 1.0
    modules.other = OTHER.replace("    a: float\n    b: float\n", "    b: float\n    a: float\n")
    made = modules.imported()
    assert made.first(made.Pair(a=1.0, b=2.0)) == 1.0


@needs_compiler
def test_a_tuple_that_was_renamed_is_compiled_for_anew(modules):
    made = modules.imported()
    assert made.first(made.Pair(1.0, 2.0)) == 1.0
    modules.other = OTHER.replace("class Pair(", "class Couple(") + "\n\nPair = Couple\n"
    made = modules.imported()
    assert made.first(made.Pair(1.0, 2.0)) == 1.0


def test_a_digest_tells_code_apart_and_not_comments(modules):
    before = digest_of(getattr(modules.imported().plain, "py_func", modules.imported().plain))
    modules.other = OTHER + "\n# a comment\n"
    assert digest_of(getattr(modules.imported().plain, "py_func", modules.imported().plain)) == before


@needs_compiler
def test_python_cannot_call_what_only_kernels_call():
    @kernel()
    def added(x):
        return x + 1

    with pytest.raises(TypeError, match="added"):
        added(1)
