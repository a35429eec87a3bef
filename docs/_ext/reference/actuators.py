"""The drives and LEDs that a body may have: what a data sheet says of each."""

from inspect import getdoc

from reference.markdown import code, sentence, table, toml
from reference.parameters import HEAD, parameter_rows
from swarmwire.comms.bodies.drives import DRIVES, Leds


def drive_tables() -> str:
    """Every kind of drive, what it is, and its keys."""
    parts: list[str] = []
    for name, kind in DRIVES.items():
        parts.append(f"{code(f'kind = {toml(name)}')}: {sentence(getdoc(kind) or '')}\n")
        parts.append(table(HEAD, parameter_rows(kind)))
    return "\n".join(parts)


def led_table() -> str:
    """The keys of a body's LEDs."""
    return table(HEAD, parameter_rows(Leds))
