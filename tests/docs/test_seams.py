"""What crosses a seam is listed, says what it is, and is used by a test."""

from itertools import chain

from tests.tools.stable import seams
from tests.tools.stable.differences import refuse_unless_as_kept
from tests.tools.stable.sources import ROOT, Name, made_in, made_of, modules, said_of, taken_by, tree_of

COMMANDS = "swarmwire.deploy.commands."  # are used by typing them
CROSSING = (
    "Other names are public than seams.txt lists. Is a new one needed, or would one that is public already do? "
    "If it is, renew the list: `python -m tests.tools.stable`."
)


def used_by_tests() -> set[Name]:
    trees = map(tree_of, (ROOT / "tests").rglob("*.py"))
    return {made_in(name) for tree in trees for name in taken_by(tree) if name[0] in modules()}


def shown(names: list[Name]) -> str:
    return ", ".join(" ".join(name) for name in names)


def test_who_takes_what_from_whom_is_as_listed():
    refuse_unless_as_kept("seams", CROSSING)


def test_all_that_is_public_says_what_it_is():
    silent = [name for name in seams.seams() if not said_of(name)]
    assert not silent, f"no docstring, and no comment behind or above: {shown(silent)}"


def test_all_that_is_public_is_used_by_a_test_itself_or_in_what_a_test_uses():
    used = used_by_tests()
    within = chain.from_iterable(of for name, of in made_of().items() if name in used or name[0].startswith(COMMANDS))
    reached = {*used, *within}
    unused = [name for name in seams.seams() if made_in(name) not in reached]
    assert not unused, f"no test uses {shown(unused)}"
