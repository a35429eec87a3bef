"""The reference's tables as Markdown: the entries that `swarmwire list` and `describe` print, and the commands."""

import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from typing import Any, cast

from typer.main import get_command

from docs import robot_radios
from docs.behaviours.shown import PAGES, page_of
from docs.dependencies import licences
from docs.reference_text import (
    code,
    default_text,
    entries,
    key_list,
    lists_of_tables,
    sentence,
    table,
    tables_of,
    text_of,
    wrapped,
)
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.cli.catalogue.kinds import kind_named, toml
from swarmwire.deploy.cli.catalogue.robots import SHEET_TABLES
from swarmwire.deploy.cli.catalogue.schema import CatalogueEntry, CatalogueParameter

LONG_FACT = 60  # characters
SCENARIOS = Path(__file__).parents[1] / "scenarios" / "behaviours"
SETTING = re.compile(r"(\w+ = .+) in (\[.+\])")  # 'kind = "wheels" in [drive]'


def rows_of(kind: str, *columns: str) -> str:
    """A row for each entry of a kind: its name, its help, then the facts of these titles; a long one is shown once."""
    rows: list[tuple[str, ...]] = []
    first: dict[str, str] = {}  # name of the first entry by fact
    for entry in entries(kind):
        facts = [_fact(entry, title) for title in columns]
        texts = [f"as {first[fact]}" if fact in first else fact for fact in facts]
        rows.append((code(entry.name), sentence(entry.help), *texts))
        first = {fact: code(entry.name) for fact in facts if len(fact) > LONG_FACT} | first
    return table((kind_named(kind).singular, "meaning", *columns), rows)


def list_of(kind: str) -> str:
    """An item for each entry of a kind: its name and its help."""
    return "\n".join(wrapped(f"- {code(entry.name)}: {sentence(entry.help)}") for entry in entries(kind)) + "\n"


def metric_lists() -> str:
    """An item for each metric: its name, kind, bounds and help; the standard metrics first."""
    parts: list[str] = []
    for title, is_standard in {"Standard metrics": True, "Other metrics": False}.items():
        listed = [entry for entry in entries("metrics") if bool(entry.mark) == is_standard]
        items = [(entry, _fact(entry, "kind"), _fact(entry, "bounds")) for entry in listed]
        texts = [f"- {code(entry.name)} ({kind}, {bounds}): {sentence(entry.help)}" for entry, kind, bounds in items]
        parts += [f"{title}:\n", *map(wrapped, texts), ""]
    return "\n".join(parts).replace(", none)", ")")


def _fact(entry: CatalogueEntry, title: str) -> str:
    """A fact of an entry: of its kind the name, of a preset's reach the distance; the page explains both."""
    fact = ({entry.mark: "yes"} | dict(entry.facts)).get(title, "")
    fact = fact.partition(":")[0] if title == "kind" else fact.removesuffix(" by path loss alone")
    return "≥ 0" if fact == "0 and more" else fact


def facts_of(kind: str, title: str) -> str:
    """A list with one fact of each entry of a kind, such as its source; entries with the same share a line."""
    named: dict[str, list[str]] = {}
    for entry in entries(kind):
        named.setdefault(dict(entry.facts)[title], []).append(code(entry.name))
    return "".join(f"- {', '.join(names)}: {fact}\n" for fact, names in named.items())


def details_of(kind: str) -> str:
    """Each entry of a kind under its name: its text, and the tables of its parameters; each table once."""
    visited: set[str] = set()
    parts: list[str] = []
    for entry in entries(kind):
        settings = [_setting(text) for _, text in entry.facts if SETTING.fullmatch(text)]
        parts += [
            f"### {code(entry.name)}\n",
            *(f"{text}\n" for text in settings),
            f"{text_of(entry)}\n",
            *tables_of(entry, visited),
        ]
    return "\n".join(parts)


def event_tables() -> str:
    """The keys that events share, then each event with its own keys."""
    keys = {
        entry.name: {key.name: key for each in entry.tables for key in each.parameters} for entry in entries("events")
    }
    shared = {"at_s": keys["kill"]["at_s"], "for_s": keys["kill"]["for_s"]}
    without = [code(name) for name, event_keys in keys.items() if "for_s" not in event_keys]
    parts = [key_list(shared.values()), f"{' and '.join(without).capitalize()} have no `for_s`.\n"]
    visited: set[str] = set()
    for entry in entries("events"):
        own_keys = [key for key in keys[entry.name].values() if key.name not in (*shared, "do")]
        parts += [f"### {code(entry.name)}\n", f"{text_of(entry)}\n", *lists_of_tables(own_keys, visited, "")]
    return "\n".join(parts)


def _setting(text: str) -> str:
    """The setting and the header of its table as code; any other text as it is."""
    return SETTING.sub(r"`\1` in `\2`", text)


def keys_of(path: str = "") -> str:
    """The keys of a scenario's table, and after them those of each table within; without a path those before any."""
    if not path:
        tables = {entry.name.partition(".")[0] for entry in entries("keys") if "." in entry.name}
        return key_list(
            entry.parameters()[0] for entry in entries("keys") if entry.name not in tables and "." not in entry.name
        )
    entries_by_name = {entry.name: entry for entry in (*entries("keys"), *entries("radio"))}
    visited: set[str] = set()
    if path != "radio":
        list(tables_of(entries_by_name["radio"], visited))  # the page of the radio has these
    return "\n".join(tables_of(entries_by_name.get(f"{path}.*", entries_by_name[path]), visited, f"{path}."))


def behaviour_table() -> str:
    """A row for each behaviour, with a link to its section."""
    rows = [
        (_link_to_behaviour(entry.name), sentence(entry.help), _by_radio(entry), dict(entry.facts)["needs"])
        for entry in entries("behaviours")
    ]
    return table(("behaviour", "what it does", "by radio", "needs"), rows)


def behaviour_details(name: str) -> str:
    """One behaviour: its needs, docstring and parameters; what one before it on the page has, too, is a link."""
    named = {_snake(entry.name): entry for entry in entries("behaviours")}
    entry, members = named[_snake(name)], PAGES[page_of(_snake(name))]
    paragraphs, links = text_of(entry).split("\n\n"), list[str]()
    remaining, same = list(entry.parameters()), list[str]()
    for before in (named[member] for member in members[: members.index(_snake(name))]):
        new = [paragraph for paragraph in paragraphs if paragraph not in text_of(before).split("\n\n")]
        if len(new) < len(paragraphs):
            link = f"[{before.name}](#{before.name.lower()})"
            paragraphs, links = new, [*links, link]
            equal = [key for key in remaining if any(_is_same(key, other) for other in before.parameters())]
            remaining = [key for key in remaining if key not in equal]
            same += [f"{', '.join(code(key.name) for key in equal)}: as in {link}.\n"] if equal else []
    if links:
        paragraphs.append(f"For the rest see {' and '.join(links)}.")
    parts = [f"Needs: {dict(entry.facts)['needs']}\n", "\n\n".join(paragraphs), ""]
    return "\n".join([*parts, *([key_list(remaining)] if remaining else []), *same])


def _is_same(key: CatalogueParameter, other: CatalogueParameter) -> bool:
    """Whether a parameter is another one with the same default and range; a text of its own may be missing."""
    return replace(key, help=key.help or other.help) == other


def _link_to_behaviour(name: str) -> str:
    """Link to the section of a behaviour."""
    return f"[{name}](behaviours/{page_of(_snake(name))}.md#{name.lower()})"


def _snake(name: str) -> str:
    """Name in snake case: pso_search for PsoSearch."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower()


def _by_radio(entry: CatalogueEntry) -> str:
    scenario = SCENARIOS / f"{_snake(entry.name)}.toml"
    return "yes" if "radio" in tomllib.loads(scenario.read_text(encoding="utf-8")) else "no"


def body_table() -> str:
    """Every figure of the bodies' sheets that differs from its key's default: a table per part, a column per body."""
    bodies = entries("bodies")
    sheets, sensors = dict[str, dict[str, str]](), dict[str, list[str]]()
    for body in bodies:
        figures = {path: key for path, key in _figures(body).items() if key.value not in (None, _defaults().get(path))}
        speeds = {title: text for title, text in body.facts if title.startswith("fastest")}
        sheets[body.name] = speeds | {path: _figure(key.value) for path, key in figures.items()}
        for fitted in (group.title.removeprefix("sensor: ") for group in body.tables if "sensor: " in group.title):
            sensors.setdefault(fitted, []).append(code(body.name))
    parts: dict[str, dict[str, None]] = {}
    for path in (path for sheet in sheets.values() for path in sheet):
        parts.setdefault(_part_of_sheet(path), {})[path] = None
    items = (wrapped(f"- {code(name)}: {', '.join(names)}") for name, names in sensors.items())
    fitted = "\n".join(["Bodies by sensor:\n", *items, ""])
    by_part = {part: _part_table(part, list(paths), sheets) for part, paths in parts.items()}
    return "\n".join([by_part.pop(""), fitted, *by_part.values()])


def _part_of_sheet(path: str) -> str:
    """Table of a data sheet that gets a table on the page: "leds", "sensors.scan"; "" for body and drive."""
    first, *deeper = path.split(".")
    return f"sensors.{deeper[0]}" if first == "sensors" else first if first in ("leds", "ros2") else ""


def _part_table(part: str, paths: list[str], sheets: dict[str, dict[str, str]]) -> str:
    """The figures of a part, with a column for the bodies that have the same; none for bodies without figures.

    Figures of bodies of one column alone follow in a line for these. Keys end in their unit.
    """
    columns: dict[tuple[str, ...], list[str]] = {}
    for name, sheet in sheets.items():
        if not sheet.keys().isdisjoint(paths):
            columns.setdefault(tuple(sheet.get(path, "") for path in paths), []).append(code(name))
    head = [code(f"[{part}]") if part else "figure", *(", ".join(names) for names in columns.values())]
    names = [code(path.removeprefix(f"{part}.")) for path in paths]
    rows, alone = list[tuple[str, ...]](), dict[int, list[str]]()
    for name, *figures in zip(names, *columns, strict=True):
        filled = [column for column, figure in enumerate(figures) if figure]
        if len(filled) == 1:
            alone.setdefault(filled[0], []).append(f"{name} {figures[filled[0]]}")
        else:
            rows.append((name, *figures))
    label = "Only" if rows else f"{head[0]} of"
    lines = [wrapped(f"{label} {head[column + 1]}: {'; '.join(figures)}.") + "\n" for column, figures in alone.items()]
    return "\n".join([*([table(head, rows)] if rows else []), *lines])


def _figures(body: CatalogueEntry) -> dict[str, CatalogueParameter]:
    """The parameters of a body by their path in its sheet."""
    sheets = [group for group in body.tables if not group.title.startswith("reading: ")]
    prefixes = {group.title: group.title.replace("sensor: ", "sensors.").replace("geometry", "") for group in sheets}
    return {f"{prefixes[group.title]}.{key.name}".strip("."): key for group in sheets for key in group.parameters}


@cache
def _defaults() -> dict[str, Any]:
    """The defaults of sheets' keys by their path."""
    sheets = {entry.name: [entry] for entry in entries("body-keys")} | {"drive": entries("drives")}
    sheets |= {f"sensors.{entry.name}": [entry] for entry in entries("sensors")}
    defaults = {
        f"{prefix}.{key.name}": key.value
        for prefix, held in sheets.items()
        for entry in held
        for each in entry.tables
        if each.title != "reading"
        for key in each.parameters
    }
    return defaults | {
        entry.name: entry.parameters()[0].value for entry in entries("body-keys") if entry.name not in SHEET_TABLES
    }


def _figure(value: Any) -> str:
    """A figure as TOML, to six digits; of a ring of sensors their number and directions."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if not isinstance(value, list | tuple) or not value or isinstance(value[0], list | tuple):
        return toml(value)
    angles = cast("Sequence[float]", value)
    steps = {round(later - earlier, 6) for earlier, later in pairwise(angles)}
    if len(steps) == 1:
        return f"{len(angles)}, every {steps.pop():g} from {angles[0]:g}"
    return f"{len(angles)}, at {', '.join(f'{angle:g}' for angle in angles)}"


def reading_table() -> str:
    """The fields of sensors' readings, and the values that their classes derive; equal ones share a row."""
    needs: dict[tuple[str, ...], list[str]] = {}
    for entry in entries("sensors"):
        for key in (key for readings in entry.tables if readings.title == "reading" for key in readings.parameters):
            row = (code(key.name), key.expected, sentence(key.help), toml(key.value))
            needs.setdefault(row, []).append(code(entry.name))
    rows = [(", ".join(names), *row) for row, names in needs.items()]
    return table(("need", "field", "shape", "meaning", "lost"), rows)


def sensor_tables() -> str:
    """The keys that all sensors of a body share; then every sensor, its text, and its own keys in a data sheet."""
    sheets = {
        entry: [key for each in entry.tables if each.title == "data sheet" for key in each.parameters]
        for entry in entries("sensors")
        if any(each.title == "reading" for each in entry.tables)
    }
    shared = [key for key in next(iter(sheets.values())) if all(key in keys for keys in sheets.values())]
    parts = ["Keys of every sensor:\n", key_list(shared)]
    for entry, keys in sheets.items():
        own_keys = [key for key in keys if key not in shared]
        parts.append(f"{code(f'[sensors.{entry.name}]')}: {text_of(entry)}\n")
        parts += lists_of_tables(own_keys, set(), "") if own_keys else ["It has no keys of its own.\n"]
    return "\n".join(parts)


def command_tables() -> str:
    """Every command: what it does, how it is called, and its options."""
    parts: list[str] = []
    for name, command in _commands(get_command(app)):
        arguments = [_option(parameter) for parameter in command.params if parameter.param_type_name == "argument"]
        options = ["[OPTIONS]"] if len(arguments) < len(command.params) else []
        call = " ".join(["swarmwire", name, *arguments, *options])
        parts.append(f"## {code(name)}\n\n{code(call)}\n\n{_help_text(command.help)}\n")
        rows = [
            (
                code(_option(parameter)),
                default_text(parameter.default or None, parameter.required),
                sentence(parameter.help or ""),
            )
            for parameter in command.params
            if not getattr(parameter, "hidden", False)
        ]
        parts += [table(("argument or option", "default", "meaning"), rows)] if rows else []
    return "\n".join(parts)


def _help_text(text: str) -> str:
    """Help of a command, whose indented paragraphs are examples, as Markdown."""
    paragraphs = text.split("\n\n")
    return "\n\n".join(
        f"```text\n{dedent(paragraph)}\n```" if paragraph.startswith("  ") else paragraph for paragraph in paragraphs
    )


def _commands(group: Any, within: str = "") -> Iterator[tuple[str, Any]]:
    """Every command with its name; those of a group within the group have its name in front."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{within}{name} ")
        else:
            yield f"{within}{name}", command


def _option(parameter: Any) -> str:
    """How it is written on the command line."""
    if parameter.param_type_name == "argument":
        return parameter.metavar or parameter.name.upper()
    value = "" if parameter.is_flag else f" {parameter.metavar or parameter.name.upper()}"
    return ", ".join(parameter.opts) + value


def body_key_list(sheet_table: str = "") -> str:
    """The keys of this table of a body's sheet; empty: those before the first table."""
    names = (
        [sheet_table]
        if sheet_table
        else [entry.name for entry in entries("body-keys") if entry.name not in SHEET_TABLES]
    )
    return key_list(key for entry in entries("body-keys") if entry.name in names for key in entry.parameters())


TABLES: dict[str, Callable[..., str]] = {
    "behaviour": behaviour_details,
    "behaviours": behaviour_table,
    "bodies": body_table,
    "body-keys": body_key_list,
    "body-sources": lambda: facts_of("bodies", "source"),
    "commands": command_tables,
    "drives": lambda: details_of("drives"),
    "events": event_tables,
    "fates": lambda: list_of("fates"),
    "fields": lambda: rows_of("fields", "bytes on air"),
    "keys": keys_of,
    "leds": lambda: body_key_list("leds"),
    "licences": lambda: table(("for", "packages", "licence"), licences()),
    "metric-details": lambda: details_of("metrics"),
    "metrics": metric_lists,
    "preset-sources": lambda: facts_of("presets", "source"),
    "presets": lambda: rows_of("presets", "reach", "longest frame", "but"),
    "readings": reading_table,
    "robot-radios": lambda: table(robot_radios.HEAD, robot_radios.rows()),
    "ros2-names": lambda: body_key_list("ros2"),
    "sensors": sensor_tables,
}
