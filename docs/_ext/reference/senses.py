"""The senses that a body may have: what a data sheet says of each."""

from inspect import getdoc

from reference.markdown import code, sentence, table
from reference.parameters import HEAD, parameter_rows
from swarmwire.comms.sheets import SHEETS


def sense_tables() -> str:
    """Every sense, what it is, and the keys of its table in a body's data sheet."""
    parts: list[str] = []
    for name, kind in SHEETS.items():
        rows = parameter_rows(kind)
        parts.append(f"{code(f'[senses.{name}]')}: {sentence(getdoc(kind) or '')}\n")
        parts.append(table(HEAD, rows) if rows else "It has no keys.\n")
    return "\n".join(parts)
