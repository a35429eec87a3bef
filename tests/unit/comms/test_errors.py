"""The tree of errors is whole."""

import re

from swarmwire.comms import errors
from tests.release.test_workspace import PARTS, ROOT


def test_the_tree_at_the_top_of_the_file_names_every_error_of_the_five_parts() -> None:
    code = "\n".join(path.read_text("utf-8") for part in PARTS for path in (ROOT / part).rglob("*.py"))
    found = {"SwarmwireError"}
    while more := set(re.findall(rf"^class (\w+)\((?:{'|'.join(found)})\):", code, re.MULTILINE)) - found:
        found |= more
    assert set(re.findall(r"^(?:\W+ )?(\w+)(?:  .*)?$", errors.__doc__ or "", re.MULTILINE)) == found


def test_bad_input_is_a_line_that_a_terminal_can_show_whatever_was_given() -> None:
    error = errors.BadInput(
        "flock.toml", "robots.\x1b[31m\n\u202e", f"expected a name, got {'x' * 5000}, did you mean y"
    )
    assert str(error).startswith("flock.toml: robots.\\x1b[31m\\n\\u202e: expected a name, got xxx")
    assert str(error).endswith("xxx, did you mean y")
    assert str(error).isprintable()
    assert len(str(error)) < 1600
    assert error.key == "robots.\x1b[31m\n\u202e", "what programs look at stays as it was"
