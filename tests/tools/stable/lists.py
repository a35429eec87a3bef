"""The lists of what users rely on, kept beside the tests. Taking something away from one is a decision.

`python -m tests.tools.stable.lists` writes them anew.
"""

from collections.abc import Callable
from pathlib import Path

from tests.tools.stable import agent, frames, records

STABLE: dict[str, Callable[[], str]] = {
    "agent": agent.text,
    "scenario": records.scenario_text,
    "summary": records.summary_text,
    "frames": frames.text,
    "tables": records.tables_text,
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
    entries: list[str] = []
    heading = ""
    lines = [line for line in text.splitlines() if line]
    indented = any(line.startswith(" ") for line in lines)  # then what is not indented is a heading
    for line in lines:
        if line.startswith("# ") or (indented and not line.startswith(" ")):
            heading = line
        entries.append(line if line == heading else f"{heading}: {line.strip()}".removeprefix(": "))
    return entries


if __name__ == "__main__":
    for _name, _text in STABLE.items():
        place_of(_name).write_text(_text(), encoding="utf-8")
        print(f"written: {place_of(_name)}")
