"""The pages that people read, and what stands in them: files to save, commands to type and what these print.

A file is a fenced block below the comment `<!-- file: name -->`. Commands are the lines that start with "$ " in a
`console` block; each line below one, up to the next, must be matched by a line that it prints, in this order, where "…"
stands for anything. Commands that cannot run here (viewers, make) stand in `text` or `sh` blocks; the words of ours are
checked. Those below the comment `<!-- needs: module -->` run where the module is installed.
"""

import os
import re
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    str(path.relative_to(ROOT))
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    if "_build" not in path.parts
)
BLOCK = re.compile(
    r"(?:^<!-- (?:file: (?P<file>\S+)|needs: (?P<needs>\S+)) -->\n)?^```(?P<kind>[^\n`]*)\n(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


def environment() -> dict[str, str]:
    """That of a user who has the programs of the tests' environment."""
    return {**os.environ, "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    file: str | None
    needs: str | None  # a module
    kind: str  # "" if there is none
    text: str


@dataclass(frozen=True)
class Command:
    """A line to type, and what the page shows of its output."""

    line: str
    shown: tuple[str, ...]


def blocks_of(page: str, kind: str) -> list[Block]:
    """The page's blocks of one kind."""
    matches = BLOCK.finditer((ROOT / page).read_text(encoding="utf-8"))
    return [Block(**match.groupdict()) for match in matches if match["kind"] == kind]


def files_of(page: str) -> dict[str, str]:
    """What the page asks to save, by name."""
    blocks = [block for kind in ("python", "toml", "xml") for block in blocks_of(page, kind)]
    return {block.file: block.text for block in blocks if block.file}


def commands_of(page: str) -> list[Command]:
    """The page's commands that can run here, in order."""
    commands: list[Command] = []
    for block in blocks_of(page, "console"):
        if block.needs and find_spec(block.needs) is None:
            continue
        for line in block.text.splitlines():
            if line.startswith("$ "):
                commands.append(Command(line[2:], ()))
            else:
                commands[-1] = Command(commands[-1].line, (*commands[-1].shown, line))
    return commands


def first_not_printed(command: Command, printed: str) -> str | None:
    """The first line that the page shows and the command did not print in its turn; None if all came."""
    lines = iter(" ".join(line.split()) for line in printed.splitlines())
    for shown in command.shown:
        pattern = ".*".join(re.escape(" ".join(part.split())) for part in shown.split("…"))
        if not any(re.fullmatch(pattern, line) for line in lines):
            return shown
    return None
