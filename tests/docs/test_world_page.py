"""The page at the top of the package world names classes, methods and files that exist."""

import ast
import re
from pathlib import Path

import pytest

from swarmwire import world

ROOT = Path(__file__).parents[2]
# For example "|-- World.move      actions -> motion      world.py"
CALL = re.compile(r"[\s|`-]*(?P<owner>[A-Z]\w+)\.(?P<method>\w+) .* (?P<file>\S+\.py)$")
CALLS = [match for line in (world.__doc__ or "").splitlines() if (match := CALL.match(line))]


def file_of(name: str) -> Path:
    part, _, inside = name.partition("/")
    if part in ("comms", "agent"):
        return ROOT / part / "swarmwire" / part / inside
    return ROOT / "world/swarmwire/world" / name


@pytest.mark.parametrize("call", CALLS, ids=lambda match: match["owner"])
def test_world_page_names_existing_methods(call: re.Match[str]) -> None:
    classes = [node for node in ast.parse(file_of(call["file"]).read_text()).body if isinstance(node, ast.ClassDef)]
    body = [node for owner in classes if owner.name == call["owner"] for node in owner.body]
    assert call["method"] in {node.name for node in body if isinstance(node, ast.FunctionDef)}


def test_world_page_names_every_step_of_the_tick() -> None:
    assert len(CALLS) >= 14
