"""The catalogue as people read it: tables as wide as the terminal, plain lines of aligned columns where it is piped."""

import json
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.deploy.catalogue.kinds import KINDS, Kind
from swarmwire.deploy.catalogue.schema import Entry, Parameter, ParameterTable
from swarmwire.deploy.terminal.tables import aligned

WIDEST_VALUE = 28  # columns of a terminal
SAID_BY_VALUE = ("a number", "a table")


def print_kinds(console: Console) -> None:
    """All kinds, with how many things there are of each."""
    _print_rows(console, ("kind", "things", "what they are"), [(k.name, str(len(k.entries())), k.help) for k in KINDS])
    _line(console, "\nswarmwire list KIND names those of one kind, swarmwire describe NAME tells about one of them")


def print_list(kind: Kind, console: Console) -> None:
    """All things of a kind, a line each."""
    entries = kind.entries()
    if any(entry.mark for entry in entries):
        _print_rows(console, (kind.one, "", kind.help), [(entry.name, entry.mark, entry.help) for entry in entries])
    else:
        _print_rows(console, (kind.one, kind.help), [(entry.name, entry.help) for entry in entries])


def print_entry(entry: Entry, console: Console) -> None:
    """Everything about one thing."""
    _line(console, f"{entry.kind} {entry.name}", "bold")
    _line(console, "\n\n".join(_told(entry)) + "\n")
    _print_rows(console, ("", ""), list(entry.facts))
    for table in entry.tables:
        _line(console, f"\n{table.title}", "bold")
        _print_rows(
            console, ("name", "unit", table.value_is, "what it is"), [_row(of, table) for of in table.parameters]
        )
        if not table.parameters:
            _line(console, "no figures")


def _told(entry: Entry) -> list[str]:
    """What is told of a thing before any figures: its help, unless its text begins with that, and its text."""
    return [part for part in ("" if entry.text.startswith(entry.help) else entry.help, entry.text) if part]


def _row(key: Parameter, table: ParameterTable) -> tuple[str, str, str, str]:
    """The cells of a parameter; a figure of a data sheet is within its bounds, which so are not of interest."""
    expected = "" if table.value_is == "value" or key.expected in SAID_BY_VALUE else key.expected
    return (
        key.name,
        key.unit,
        "required" if key.required else toml(key.value),
        "\n".join(part for part in (key.help, expected) if part),
    )


def toml(value: Any) -> str:
    """A number, a text or a list of them as TOML; nothing for None."""
    return "" if value is None else json.dumps(value, ensure_ascii=False, default=str)


def _print_rows(console: Console, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    if not rows:
        return
    if console.is_terminal:
        console.print(_table(headings, rows))
        return
    cells = [[cell.replace("\n", "; ") for cell in row] for row in ([headings, *rows] if any(headings) else rows)]
    for line in aligned(cells):
        _line(console, line)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=None, show_header=any(headings), header_style="dim", pad_edge=False, padding=(0, 2, 0, 0))
    last = len(headings) - 1
    for place, heading in enumerate(headings):
        whole = place < min(last, 2)  # names and units are not broken
        style, widest = "cyan" if place == 0 else "", None if whole or place == last else WIDEST_VALUE
        table.add_column(Text(heading), style=style, no_wrap=whole, max_width=widest, overflow="fold")
    for row in rows:
        table.add_row(*(_cell(text) for text in row))
    return table


def _cell(text: str) -> Text:
    """A cell whose lines after the first are dim."""
    first, newline, rest = text.partition("\n")
    return Text.assemble(first, newline, (rest, "dim"))


def _line(console: Console, text: str, style: str = "") -> None:
    console.print(Text(text, style), soft_wrap=not console.is_terminal)
