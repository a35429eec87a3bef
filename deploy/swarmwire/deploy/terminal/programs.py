"""The project's programs, as people can type them."""

import sys
from pathlib import Path


def program(name: str = "swarmwire") -> Path:
    """A program beside this one, as people can type it here: it need not be on their path, as with `uv run`."""
    called = Path(sys.argv[0])
    beside = called.with_name(name)
    if called.name != "swarmwire" or not beside.exists():  # python -m, a program of others
        return Path(name)
    return beside.relative_to(Path.cwd()) if beside.is_relative_to(Path.cwd()) else beside
