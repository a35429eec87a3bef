"""The lists that are kept beside the tests, a change to which is a decision: what is public, and what is stable."""

from collections.abc import Callable
from pathlib import Path

from tests.tools.stable import agent, frames, scenario, seams, summary, tables

STABLE: dict[str, Callable[[], str]] = {
    "agent": agent.text,
    "scenario": scenario.text,
    "summary": summary.text,
    "frames": frames.text,
    "tables": tables.text,
}
KEPT = {"seams": seams.text, **STABLE}


def place_of(name: str) -> Path:
    """The file of a list."""
    return Path(__file__).parent / f"{name}.txt"
