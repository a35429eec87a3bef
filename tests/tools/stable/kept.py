"""The lists that are kept beside the tests: what users rely on. Taking something away from one is a decision."""

from collections.abc import Callable
from pathlib import Path

from tests.tools.stable import agent, frames, scenario, summary, tables

STABLE: dict[str, Callable[[], str]] = {
    "agent": agent.text,
    "scenario": scenario.text,
    "summary": summary.text,
    "frames": frames.text,
    "tables": tables.text,
}


def place_of(name: str) -> Path:
    """The file of a list."""
    return Path(__file__).parent / f"{name}.txt"


def removed(name: str) -> list[str]:
    """The entries of a kept list that the code no longer has; what was added does not count."""
    now = set(_entries(STABLE[name]()))
    return [entry for entry in _entries(place_of(name).read_text(encoding="utf-8")) if entry not in now]


def _entries(text: str) -> list[str]:
    """Every line, with the heading that it stands under."""
    found: list[str] = []
    heading = ""
    lines = [line for line in text.splitlines() if line]
    indented = any(line.startswith(" ") for line in lines)  # then what is not indented is a heading
    for line in lines:
        if line.startswith("# ") or (indented and not line.startswith(" ")):
            heading = line
        found.append(line if line == heading else f"{heading}: {line.strip()}".removeprefix(": "))
    return found
