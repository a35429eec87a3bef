"""How the catalogue's entries and their parameters look on a page: items of lists, tables, values, sentences."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from textwrap import wrap
from typing import Any

from swarmwire.deploy.cli.catalogue.kinds import kind_named, toml
from swarmwire.deploy.cli.catalogue.schema import UNITS, CatalogueEntry, CatalogueParameter

NOTHING = "–"
ONLY_WITH = re.compile(r"\(only with \w+ = ([^)]+)\)")  # behind the help of a key of some choices
MARKUP = re.compile(r" *([-+*>#|=~]|\d+[.)])")
ONLY = re.compile(r"(.+ only): ")  # before the help of a key of some models
CHOICES = re.compile(r"one of ([\w.-]+(?:, [\w.-]+)*)|(?!true or false)([a-z]\w*(?: or [a-z]\w*)+)")
NUMBER = r"(-?[\d.e+-]+)"
RANGES = {  # texts of `expected` as regular expressions, and what replaces them
    rf"\ba (whole )?number of at least {NUMBER} and at most {NUMBER}": r"\1\2 to \3",
    rf"\ba (whole )?number above {NUMBER} and at most {NUMBER}": r"\1> \2, ≤ \3",
    rf"\ba (whole )?number of at least {NUMBER} and below {NUMBER}": r"\1≥ \2, < \3",
    rf"\ba (whole )?number above {NUMBER} and below {NUMBER}": r"\1> \2, < \3",
    rf"\ba (whole )?number of at least {NUMBER}": r"\1≥ \2",
    rf"\ba (whole )?number above {NUMBER}": r"\1> \2",
    rf"\bnumbers of at least {NUMBER} and at most {NUMBER}": r"numbers, \1 to \2",
    rf"\bnumbers above {NUMBER} and at most {NUMBER}": r"numbers > \1, ≤ \2",
    r"\ba (whole )?number\b": r"\1number",
    r"\b1000000000\b": "1e9",
    " that is not empty": "",
}
WIDTH = 120  # characters of a line of a page


def entries(kind: str) -> list[CatalogueEntry]:
    """The catalogue's entries of this kind."""
    return kind_named(kind).entries()


def text_of(entry: CatalogueEntry) -> str:
    """What an entry says before its figures."""
    return entry.text or sentence(entry.help)


def tables_of(entry: CatalogueEntry, visited: set[str], prefix: str = "") -> list[str]:
    """The tables of an entry's parameters, one for each table of keys, unless `visited` has it already."""
    return [part for each in entry.tables for part in lists_of_tables(each.parameters, visited, prefix)]


def lists_of_tables(parameters: Iterable[CatalogueParameter], visited: set[str], prefix: str) -> Iterator[str]:
    """The keys without a point, then those of each table within, under its name and its help.

    Keys that an earlier table has alike, and choices that their key's help describes, are not shown again.
    """
    rows, held = dict[str, list[CatalogueParameter]](), dict[str, CatalogueParameter]()
    shown_rows: dict[tuple[str, ...], str] = {}  # name of its table by row
    tables_only: list[CatalogueParameter] = []  # keys that are named, not shown as rows
    for key in parameters:
        table_name, _, name = key.name.rpartition(".")
        rows.setdefault(table_name, []).append(replace(key, name=name))
        held[key.name] = key
    for name, keys in rows.items():
        shown = key_list(keys)
        if name and shown in visited:
            continue
        visited.add(shown)
        if table_key := held.get(name) or held.get(name.removesuffix(".*")):
            text = table_key.text or sentence(table_key.help)
            if table_key in tables_only and table_key.help.rstrip(".") not in text:
                condition = ONLY.match(table_key.help)
                text = f"{sentence(condition[1] if condition else table_key.help)} {text}"
            yield f"{code(prefix + name.removesuffix('.*'))}: {text}\n"
        earlier = [key for key in keys if _row(key) in shown_rows]
        earlier = earlier if len(earlier) > 1 else []
        within = [key for key in keys if key.expected == "a table" and not key.required and key not in earlier]
        paths = {key.name: f"{name}.{key.name}".strip(".") for key in within}
        within = [key for key in within if paths[key.name] in rows and key_list(rows[paths[key.name]]) not in visited]
        tables_only += [held[paths[key.name]] for key in within]
        if shown_keys := [key for key in keys if key not in (*earlier, *within)]:
            yield key_list(shown_keys)
        if within:
            yield f"Tables: {', '.join(code(key.name) for key in within)}.\n"
        if earlier:
            tables = " and ".join(dict.fromkeys(code(prefix + shown_rows[_row(key)]) for key in earlier))
            yield f"{', '.join(code(key.name) for key in earlier)}: as in {tables}.\n"
        shown_rows = {_row(key): name.removesuffix(".*") for key in keys} | shown_rows
        deeper = tuple(f"{name}.{key.name}".strip(".") for key in keys if key.text)
        yield from (
            f"{text}\n"
            for path in deeper
            if not any(row_name.startswith(path) for row_name in rows)
            for text in held[path].text.split("\n\n")
            if text.partition(": ")[2].rstrip(".") not in held[path].help
        )


def key_list(keys: Iterable[CatalogueParameter]) -> str:
    """A list with an item for each parameter: accepted values, default, meaning."""
    return "\n".join(_item(*_row(key)) for key in keys) + "\n"


def _item(name: str, expected: str, default: str, meaning: str) -> str:
    """The item of a parameter."""
    expected = "" if expected == "number" and default else expected
    values = [text for text in (expected, default if default in ("", "required") else f"default {default}") if text]
    return wrapped(f"- {name}: {', '.join(values)}. {meaning}" if values else f"- {name}: {meaning}")


def wrapped(item: str) -> str:
    """An item or a paragraph; in one line where a part of it would be Markdown of its own at the start of a line."""
    indent = "  " if item.startswith("- ") else ""
    lines = wrap(item.strip(), WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return item.strip() if any(MARKUP.match(line) for line in lines[1:]) else "\n".join(lines)


def _row(key: CatalogueParameter) -> tuple[str, ...]:
    is_named = any(key.name.endswith(ending) for ending, unit in UNITS.items() if unit == key.unit)
    expected = _expected(key) if is_named else _with_unit(_expected(key), key.unit)
    meaning = ONLY_WITH.sub(lambda match: f"(only {match[1].replace(' or ', ', ')})", key.help)
    return code(key.name), expected, default_text(key.value, key.required), sentence(meaning)


def _expected(key: CatalogueParameter) -> str:
    """Accepted values of a key: ranges in symbols, texts to choose from as TOML has them."""
    if choices := CHOICES.fullmatch(key.expected):
        names = (choices[1] or choices[2]).replace(" or ", ", ").split(", ")
        return f"one of {', '.join(code(toml(name)) for name in names)}"
    expected = key.expected
    for words, symbols in RANGES.items():
        expected = re.sub(words, symbols, expected)
    return expected


def _with_unit(text: str, unit: str) -> str:
    """A text with its unit behind it, unless it has that already."""
    return text if not unit or text.endswith(f"({unit})") else f"{text} ({unit})"


def default_text(value: Any, required: bool) -> str:
    """A default as TOML; empty without one."""
    return "required" if required else "" if value is None else code(toml(value))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a bar within a cell stays one, an empty cell is a dash."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ") or NOTHING


def code(text: str) -> str:
    """The text as code."""
    return f"`{text}`"


def sentence(text: str) -> str:
    """The text without line breaks, from a capital letter to a full stop."""
    flat = " ".join(text.split())
    return flat[:1].upper() + flat[1:] + ("" if not flat or flat.endswith((".", "?", "!")) else ".")
