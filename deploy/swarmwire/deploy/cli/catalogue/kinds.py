"""The kinds of things that a scenario, an agent or a command can name: found by name, and as people read them.

Tables are as wide as the terminal; where they are piped they are plain lines of aligned columns.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.catalogue.agents import behaviour, behaviours, drivers, gateways, message_fields
from swarmwire.deploy.cli.catalogue.robots import bodies, body_of, drives, sensors, sheet_keys
from swarmwire.deploy.cli.catalogue.scenario import (
    engines,
    events,
    fates,
    keys,
    metrics,
    presets,
    radio_keys,
    radio_stages,
)
from swarmwire.deploy.cli.catalogue.schema import CatalogueEntry, CatalogueParameter, ParameterTable
from swarmwire.deploy.terminal.tables import aligned
from swarmwire.world.scenario.bodies import sheet_path


@dataclass(frozen=True)
class Kind:
    """One kind."""

    name: str  # as in `swarmwire list NAME`
    one: str  # as in `swarmwire describe ONE:name`, and the `kind` of its entries
    help: str  # one line
    entries: Callable[[], list[CatalogueEntry]]


KINDS = (
    Kind("bodies", "body", "kinds of robot: size, drive and sensors", bodies),
    Kind("drives", "drive", "drives of bodies, with the keys of their tables", drives),
    Kind("body-keys", "body-key", "keys of a body's file; its drive and sensors are kinds of their own", sheet_keys),
    Kind("sensors", "sensor", "sensors and packet measurements that an agent may read if its needs name them", sensors),
    Kind("behaviours", "behaviour", "agents that come with swarmwire, with their parameters", behaviours),
    Kind("fields", "field", "types of a message's fields", message_fields),
    Kind("events", "event", "scheduled changes of robots and radios", events),
    Kind("metrics", "metric", "measures of a run; the standard ones are in every run", metrics),
    Kind("radio", "radio", "keys of a scenario's radio", radio_keys),
    Kind("presets", "preset", "kinds of radio that a scenario may name", presets),
    Kind("stages", "stage", "stages of a packet on its way to a receiver, in order", radio_stages),
    Kind("fates", "fate", "final states of a packet at one receiver", fates),
    Kind("engines", "engine", "physics engines that move the bodies", engines),
    Kind("drivers", "driver", "real robots that swarmwire-agent can drive", drivers),
    Kind("gateways", "gateway", "real robots that robots of a run can answer as", gateways),
    Kind("keys", "key", "all other keys of a scenario", keys),
)


def kind_named(name: str) -> Kind:
    """The kind of this name, singular or plural; BadInput if there is none."""
    found = next((kind for kind in KINDS if name.lower() in (kind.name, kind.one)), None)
    if found is None:
        kinds = did_you_mean((kind.name for kind in KINDS), name)
        raise BadInput(name, "", f"expected {kinds}; swarmwire describe NAME describes one name")
    return found


def find(name: str) -> CatalogueEntry:
    """What `name` names: alone, as "kind:name", an agent as "module:Class" or "file.py:Class", a body as "sheet.toml".

    Keys of a scenario may leave out how they begin, as far as that is clear, and may hold a group's name for `*`.
    BadInput if nothing has the name, with the nearest that there are, or if several things have it.
    """
    if sheet_path(name, ""):
        return body_of(Path(name))
    if name.endswith(".py"):
        raise BadInput(name, "", f"expected the class in it, too: {name}:Class")
    before, colon, rest = name.partition(":")
    chosen = [kind for kind in KINDS if colon and before.lower() in (kind.name, kind.one)]
    if colon and not chosen:
        return behaviour(name)
    entries = [entry for kind in chosen or KINDS for entry in kind.entries()]
    asked = rest if chosen else name
    found = (
        [entry for entry in entries if entry.name == asked]  # Aggregation is a behaviour, aggregation a metric
        or [entry for entry in entries if _is(entry.name, asked)]
        or [entry for entry in entries if _is(entry.name, asked, ends=True)]
    )
    if not found:
        raise BadInput(name, "", _nearest(asked, entries))
    if len(found) > 1:
        raise BadInput(name, "", f"several things have this name; say which: {', '.join(_full_names(found))}")
    return found[0]


def _is(name: str, asked: str, ends: bool = False) -> bool:
    """Whether `asked` is the name, whole or how it `ends`, part by part; a `*` in it is any part."""
    parts, wanted = name.lower().split("."), asked.lower().split(".")
    if ends:
        parts = parts[-len(wanted) :]
        if parts[-1] != wanted[-1]:  # else any word would name the table robots.*
            return False
    return len(parts) == len(wanted) and all(part in ("*", want) for part, want in zip(parts, wanted, strict=True))


def _full_names(entries: Sequence[CatalogueEntry]) -> list[str]:
    names = [entry.name for entry in entries]
    return names if len(set(names)) == len(names) else [f"{entry.kind}:{entry.name}" for entry in entries]


def _nearest(asked: str, entries: Sequence[CatalogueEntry]) -> str:
    """What to try instead: the names nearest to the one asked for, or to the last part of a path."""
    if any(asked.lower() in (kind.name, kind.one) for kind in KINDS):
        return f"this is a kind of things; swarmwire list {kind_named(asked).name} names them"
    names = {entry.name.lower(): entry.name for entry in entries}
    names |= {entry.name.rpartition(".")[2].lower(): entry.name for entry in reversed(entries) if "." in entry.name}
    close = dict.fromkeys(names[match] for match in get_close_matches(asked.lower(), names, n=4, cutoff=0.6))
    nearest = f"nearest: {', '.join(close)}" if close else "nothing is near it"
    return f"nothing has this name; {nearest} (swarmwire list names all)"


WIDEST_VALUE = 28  # columns of a terminal
SAID_BY_VALUE = ("a number", "a table")


def print_kinds(console: Console) -> None:
    """All kinds, with how many things there are of each."""
    _print_rows(console, ("kind", "names", "description"), [(k.name, str(len(k.entries())), k.help) for k in KINDS])
    _line(console, "\nswarmwire list KIND lists one kind, swarmwire describe NAME describes one name")


def print_list(kind: Kind, console: Console) -> None:
    """All things of a kind, a line each."""
    entries = kind.entries()
    if any(entry.mark for entry in entries):
        _print_rows(console, (kind.one, "", kind.help), [(entry.name, entry.mark, entry.help) for entry in entries])
    else:
        _print_rows(console, (kind.one, kind.help), [(entry.name, entry.help) for entry in entries])


def print_entry(entry: CatalogueEntry, console: Console) -> None:
    """Everything about one thing."""
    _line(console, f"{entry.kind} {entry.name}", "bold")
    _line(console, "\n\n".join(_told(entry)) + "\n")
    _print_rows(console, ("", ""), list(entry.facts))
    for table in entry.tables:
        _line(console, f"\n{table.title}", "bold")
        _print_rows(
            console, ("name", "unit", table.value_is, "description"), [_row(of, table) for of in table.parameters]
        )
        if not table.parameters:
            _line(console, "no figures")


def _told(entry: CatalogueEntry) -> list[str]:
    """What is told of a thing before any figures: its help, unless its text begins with that, and its text."""
    return [part for part in ("" if entry.text.startswith(entry.help) else entry.help, entry.text) if part]


def _row(key: CatalogueParameter, table: ParameterTable) -> tuple[str, str, str, str]:
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
