"""This program as people can type it."""

import sys
from pathlib import Path


def program() -> Path:
    """As people can type it here: it need not be on their path, as with `uv run`."""
    called = Path(sys.argv[0])
    if called.name != "swarmwire":  # python -m
        return Path("swarmwire")
    return called.relative_to(Path.cwd()) if called.is_relative_to(Path.cwd()) else called
