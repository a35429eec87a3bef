"""The fault tables of docs/fault-evidence.md: every named test exists, and every fault names at least one.

A section with a fault table has a list "Tests:" below it, with an entry for each row: "- fault: `path::name`, …".
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = Path("docs/fault-evidence.md")
HEADER = "| fault | symptom |"
FOLDER = re.compile(r"`(tests/[\w/]+/)`")
FILE = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+)[^`]*)?`")


def fault_tables() -> Iterator[str]:
    """A line for each test, file or folder that does not exist, and for each table whose rows and tests differ."""
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    yield from (f"{PAGE}: no {name}" for name in FOLDER.findall(text) if not (ROOT / name).is_dir())
    yield from (f"{PAGE}: no {path}::{name}" for path, name in FILE.findall(text) if not _exists(ROOT / path, name))
    sections = [section for section in re.split(r"\n##+ ", text) if HEADER in section]
    if not sections:
        yield f"{PAGE}: no table that begins with {HEADER}"
    for section in sections:
        title, _, body = section.partition("\n")
        table, _, tests = body.partition("\nTests:\n")
        _, _, *rows = [line.split(" | ")[0].removeprefix("| ") for line in table.splitlines() if line.startswith("| ")]
        listed = [line.split(": `tests/")[0].removeprefix("- ") for line in tests.splitlines() if ": `tests/" in line]
        if rows != listed:
            differing = sorted(set(rows) ^ set(listed)) or "in another order"
            yield f"{PAGE}: {title}: the rows of the table and the entries below 'Tests:' differ: {differing}"


def _exists(file: Path, name: str) -> bool:
    if not file.is_file():
        return False
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return not name or any(isinstance(node, ast.FunctionDef) and node.name == name for node in ast.walk(tree))
