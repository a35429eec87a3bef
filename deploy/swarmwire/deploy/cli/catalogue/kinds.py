"""The kinds of names of `swarmwire list` and `describe`, their search and their output.

Tables are as wide as the terminal, or plain lines of aligned columns in a pipe.
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
from swarmwire.comms.base.plugins import NotLoaded, load_named, resolve
from swarmwire.deploy.cli.catalogue.agents import behaviour, behaviours, drivers, gateways, message_fields
from swarmwire.deploy.cli.catalogue.robots import bodies, body_of, drives, sensors, sheet_keys
from swarmwire.deploy.cli.catalogue.scenario import (
    custom_metric,
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
from swarmwire.deploy.terminal.console import aligned
from swarmwire.metrics.measures.metric import Metric
from swarmwire.world.scenario.bodies import sheet_path


@dataclass(frozen=True)
class Kind:
    """A kind of names."""

    name: str  # plural, for `swarmwire list`
    singular: str  # prefix of `swarmwire describe SINGULAR:name`, and `kind` of the entries
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
    """Return a kind by its singular or plural; BadInput for an unknown one."""
    match = next((kind for kind in KINDS if name.lower() in (kind.name, kind.singular)), None)
    if match is None:
        kinds = did_you_mean((kind.name for kind in KINDS), name)
        raise BadInput(name, "", f"expected {kinds}; swarmwire describe NAME describes one name")
    return match


def find(name: str) -> CatalogueEntry:
    """Return the entry of a name: "name", "kind:name", a class "module:Class" or "file.py:Class", or a "sheet.toml".

    The class is an agent's or a metric's. A key of a scenario may be shortened to its last parts, and may have a
    group's name for `*`. BadInput for an unknown name, with the nearest names, and for a name of several entries.
    """
    if sheet_path(name, ""):
        return body_of(Path(name))
    if name.endswith(".py"):
        raise BadInput(name, "", f"expected the class in it, too: {name}:Class")
    prefix, colon, suffix = name.partition(":")
    chosen = [kind for kind in KINDS if colon and prefix.lower() in (kind.name, kind.singular)]
    if colon and not chosen:
        return _custom(name)
    entries = [entry for kind in chosen or KINDS for entry in kind.entries()]
    query = suffix if chosen else name
    matches = (
        [entry for entry in entries if entry.name == query]  # Aggregation is a behaviour, aggregation a metric
        or [entry for entry in entries if _matches(entry.name, query)]
        or [entry for entry in entries if _matches(entry.name, query, ends=True)]
    )
    if not matches:
        raise BadInput(name, "", _nearest(query, entries))
    if len(matches) > 1:
        raise BadInput(name, "", f"several things have this name; say which: {', '.join(_full_names(matches))}")
    return matches[0]


def _custom(spec: str) -> CatalogueEntry:
    """Return the agent or the metric of "module:Class" or "file.py:Class", relative to the working directory."""
    try:
        kind = load_named(resolve(spec, Path.cwd()))
    except NotLoaded:
        kind = None  # as an agent, the error gives the reason
    return custom_metric(spec) if isinstance(kind, type) and issubclass(kind, Metric) else behaviour(spec)


def _matches(name: str, query: str, ends: bool = False) -> bool:
    """Return True if the query is the name, or its end, part by part; a `*` of the name matches any part."""
    parts, query_parts = name.lower().split("."), query.lower().split(".")
    if ends:
        parts = parts[-len(query_parts) :]
        if parts[-1] != query_parts[-1]:  # any word would match the table robots.*
            return False
    return len(parts) == len(query_parts) and all(
        part in ("*", query_part) for part, query_part in zip(parts, query_parts, strict=True)
    )


def _full_names(entries: Sequence[CatalogueEntry]) -> list[str]:
    names = [entry.name for entry in entries]
    return names if len(set(names)) == len(names) else [f"{entry.kind}:{entry.name}" for entry in entries]


def _nearest(query: str, entries: Sequence[CatalogueEntry]) -> str:
    """Return a text on the names nearest to the query, or on a kind."""
    if any(query.lower() in (kind.name, kind.singular) for kind in KINDS):
        return f"this is a kind of things; swarmwire list {kind_named(query).name} names them"
    names = {entry.name.lower(): entry.name for entry in entries}
    names |= {entry.name.rpartition(".")[2].lower(): entry.name for entry in reversed(entries) if "." in entry.name}
    close = dict.fromkeys(names[match] for match in get_close_matches(query.lower(), names, n=4, cutoff=0.6))
    nearest = f"nearest: {', '.join(close)}" if close else "nothing is near it"
    return f"nothing has this name; {nearest} (swarmwire list names all)"


MAX_VALUE_WIDTH = 28  # columns of a terminal
EVIDENT = ("a number", "a table")  # expectations that the value shows


def print_kinds(console: Console) -> None:
    """Print all kinds, with their number of names."""
    _print_rows(console, ("kind", "names", "description"), [(k.name, str(len(k.entries())), k.help) for k in KINDS])
    _line(console, "\nswarmwire list KIND lists one kind, swarmwire describe NAME describes one name")


def print_list(kind: Kind, console: Console) -> None:
    """Print a line for each name of a kind."""
    entries = kind.entries()
    if any(entry.mark for entry in entries):
        _print_rows(
            console, (kind.singular, "", kind.help), [(entry.name, entry.mark, entry.help) for entry in entries]
        )
    else:
        _print_rows(console, (kind.singular, kind.help), [(entry.name, entry.help) for entry in entries])


def print_entry(entry: CatalogueEntry, console: Console) -> None:
    """Print an entry with all its tables."""
    _line(console, f"{entry.kind} {entry.name}", "bold")
    _line(console, "\n\n".join(_paragraphs(entry)) + "\n")
    _print_rows(console, ("", ""), list(entry.facts))
    for table in entry.tables:
        _line(console, f"\n{table.title}", "bold")
        _print_rows(
            console,
            ("name", "unit", table.value_is, "description"),
            [_row(parameter, table) for parameter in table.parameters],
        )
        if not table.parameters:
            _line(console, "no figures")


def _paragraphs(entry: CatalogueEntry) -> list[str]:
    """Return the help, unless the text begins with it, and the text."""
    return [part for part in ("" if entry.text.startswith(entry.help) else entry.help, entry.text) if part]


def _row(key: CatalogueParameter, table: ParameterTable) -> tuple[str, str, str, str]:
    """Return the cells of a parameter; bounds of a figure of a data sheet are left out."""
    expected = "" if table.value_is == "value" or key.expected in EVIDENT else key.expected
    return (
        key.name,
        key.unit,
        "required" if key.required else toml(key.value),
        "\n".join(part for part in (key.help, expected) if part),
    )


def toml(value: Any) -> str:
    """Return a number, a text or a list as TOML; an empty text for None."""
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
    for index, heading in enumerate(headings):
        no_wrap = index < min(last, 2)  # names and units
        style, max_width = "cyan" if index == 0 else "", None if no_wrap or index == last else MAX_VALUE_WIDTH
        table.add_column(Text(heading), style=style, no_wrap=no_wrap, max_width=max_width, overflow="fold")
    for row in rows:
        table.add_row(*(_cell(text) for text in row))
    return table


def _cell(text: str) -> Text:
    """Return a cell with dim lines after the first."""
    first, newline, others = text.partition("\n")
    return Text.assemble(first, newline, (others, "dim"))


def _line(console: Console, text: str, style: str = "") -> None:
    console.print(Text(text, style), soft_wrap=not console.is_terminal)
