"""The list of mutants that survive is of lines that are there, and each says why it stays."""

from pathlib import Path

from tests.tools.mutants.__main__ import looked_at
from tests.tools.mutants.groups import GROUPS

COMMS = Path("comms/swarmwire/comms")


def test_each_survivor_is_a_line_of_its_module_and_has_a_reason() -> None:
    named = {name for group in GROUPS.values() for name in group}
    for (module, before, after), why in looked_at().items():
        assert module in named
        lines = (COMMS / f"{module.replace('.', '/')}.py").read_text().splitlines()
        assert before in map(str.strip, lines), f"{module}: {before}"
        assert before != after
        assert why


def test_every_test_that_is_to_kill_mutants_is_there() -> None:
    for group in GROUPS.values():
        for tests in group.values():
            for test in tests:
                path, _, name = test.removeprefix("--deselect=").partition("::")
                assert f"def {name}" in Path(path).read_text()
