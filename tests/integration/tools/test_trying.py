"""What counts as killed: a change that a test notices, or that never ends, breaks the import or takes all memory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

MODULE = """
LEAST = 2
ALIASES = {"few": LEAST}


class Counter:
    @classmethod
    def from_least(cls):
        return cls(LEAST)

    def __init__(self, number):
        self._number = number

    @property
    def number(self):
        return self._number + 0


def count(number):
    while number < LEAST:
        number += 1
    return number
"""
TESTS = """
from swarm_counter import ALIASES, Counter, count


def test_count():
    assert [count(0), count(5)] == [2, 5]
    assert Counter.from_least().number == ALIASES["few"]
"""
# In a process of its own, where a mutant may have one second.
TRY = """
import json, sys
from pathlib import Path
from tests.tools.mutants import trying
from tests.tools.mutants.mutant import Mutant, is_inside

folder = Path(sys.argv[1])
sys.path.insert(0, str(folder))
trying.HEAVY, trying.LEAST_S, trying.TIMES = (), 4, 1
path, mutants = folder / "swarm_counter.py", []
source = path.read_text()
for before, after in json.loads(sys.argv[2]):
    line = source[: source.index(before)].count(chr(10)) + 1
    changed = source.replace(before, after, 1)
    mutants.append(Mutant("swarm_counter", path, line, before, after, changed, is_inside(line, source)))
said = {}
tell = lambda of: said.update({of.mutant.after: of.killed})
trying.attempts("swarm_counter", mutants, [str(folder / "test_counter.py")], tell)
print(json.dumps(said))
"""


def killed(folder: Path, *changes: tuple[str, str]) -> dict[str, bool]:
    (folder / "swarm_counter.py").write_text(MODULE)
    (folder / "test_counter.py").write_text(TESTS)
    command = [sys.executable, "-c", TRY, str(folder), json.dumps(changes)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_changes_that_matter_are_killed_and_others_survive(tmp_path: Path) -> None:
    matters = [
        ("return number\n", "return number + 1\n"),  # of a function
        ("return self._number + 0", "return self._number + 1"),  # of a property
        ("return cls(LEAST)", "return cls(3)"),  # of a class's method
        ("LEAST = 2", "LEAST = 3"),  # when it is imported
        ("LEAST = 2", "LEAST = 2 / 0"),  # it cannot be imported
        ("number += 1", "number -= 1"),  # never ends
    ]
    nothing = [("number < LEAST", "not number >= LEAST"), ("LEAST = 2", "LEAST = 2.0"), ("+ 0", "- 0")]
    assert killed(tmp_path, *matters, *nothing) == {
        **{after: True for _, after in matters},
        **{after: False for _, after in nothing},
    }


def test_tests_that_fail_without_a_change_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "swarm_counter.py").write_text(MODULE)
    (tmp_path / "test_counter.py").write_text("def test_wrong():\n    assert False\n")
    command = [sys.executable, "-c", TRY, str(tmp_path), "[]"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "the tests cannot be run" in done.stderr


def test_mutants_are_of_every_kind_and_not_of_types(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cosmic_ray", reason="only `make mutants` brings cosmic-ray")
    from tests.tools.mutants.mutations import mutants_of

    (tmp_path / "swarm_sum.py").write_text(
        'def both(a: int | None, b: int = 1) -> "int | None":\n    """2 + 2."""\n    return a + b if a else -b\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    found = mutants_of("swarm_sum", 2)
    assert all(mutant.source.startswith("def both(a: int | None, b: int") for mutant in found)
    assert {(mutant.line, mutant.is_inside) for mutant in found} == {(1, False), (3, True)}
    assert len({mutant.source for mutant in found}) == len(found) >= 6
    assert [mutant.after for mutant in mutants_of("swarm_sum", 2)] == [mutant.after for mutant in found]
