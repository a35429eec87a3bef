"""The tree of errors is whole."""

import re

from swarmwire.comms import errors
from tests.test_workspace import PARTS, ROOT


def test_the_tree_at_the_top_of_the_file_names_every_error_of_the_five_parts() -> None:
    code = "\n".join(path.read_text("utf-8") for part in PARTS for path in (ROOT / part).rglob("*.py"))
    found = {"SwarmwireError"}
    while more := set(re.findall(rf"^class (\w+)\((?:{'|'.join(found)})\):", code, re.MULTILINE)) - found:
        found |= more
    assert set(re.findall(r"^(?:\W+ )?(\w+)(?:  .*)?$", errors.__doc__ or "", re.MULTILINE)) == found
