"""A TOML reader that skips broken lines, for emergency stops."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import from_toml
from swarmwire.comms.base.errors import BadInput

MAX_LINES = 50  # longest value; a line whose value is longer is skipped
_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
# The beginning of a table's header; any text may follow the key.
HEADER = re.compile(rf"\s*\[\s*({_KEY}(?:\s*\.\s*{_KEY})*)(?![\w-])(?!\s*\.)", re.ASCII)
Table = dict[str, Any]


def read_fragments(file: Path) -> Iterator[Table]:
    """Read a TOML file; where it is not valid, yield a table for each value that can be read, in order.

    BadInput if the file cannot be read.
    """
    try:
        text = file.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise BadInput(str(file), "", f"expected a readable file: {error.strerror}") from None
    return fragments(text)


def fragments(text: str) -> Iterator[Table]:
    r"""Yield the tables of a text (see `read_fragments`).

    >>> list(fragments('[a]\nx = 1\ny = "ha\n[b\nx = 2'))
    [{'a': {}}, {'a': {'x': 1}}, {'b': {}}, {'b': {'x': 2}}]
    """
    try:
        yield from_toml(text)
        return
    except tomllib.TOMLDecodeError:
        pass
    lines = text.splitlines()
    header: str | None = ""  # None: unknown, so that the values below it belong to no table
    while lines:
        size, fragment = _first_value(lines)
        if lines[0].lstrip().startswith("["):
            start = HEADER.match(lines[0])
            header = lines[0] if fragment is not None else f"[{start[1]}]" if start else None
            if header is not None:
                yield from_toml(header)
        elif fragment and header is not None:
            yield from_toml("\n".join([header, *lines[:size]]))
        del lines[:size]


def _first_value(lines: Sequence[str]) -> tuple[int, Table | None]:
    """Return the number of lines of the first value, and its table; None for a line that is not TOML."""
    for size in range(1, min(len(lines), MAX_LINES) + 1):
        try:
            return size, from_toml("\n".join(lines[:size]))
        except tomllib.TOMLDecodeError:
            continue
    return 1, None


def merge(table: Table, more: Mapping[str, Any]) -> None:
    """Add the keys of `more`, and those of its tables; existing values stay."""
    for key, value in more.items():
        if isinstance(value, dict) and isinstance(table.setdefault(key, {}), dict):
            merge(table[key], cast("Table", value))
        else:
            table.setdefault(key, value)


def table_in(table: Mapping[str, Any], key: str) -> Table:
    """Return the table at this key; an empty table if the value is no table."""
    value = table.get(key)
    return cast("Table", value) if isinstance(value, dict) else {}
