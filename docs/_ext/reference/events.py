"""The actions of events, from their registry: what each does and which keys it takes."""

from inspect import getdoc

from reference.keys import schema, tables_of
from reference.markdown import code, sentence
from swarmwire.comms.events.registry import ACTIONS


def event_tables() -> str:
    """Every action with its keys; the table that chooses robots comes once, after the first action that has it."""
    seen: set[str] = set()
    actions = schema()["properties"]["events"]["items"]
    name_of = {ref.rsplit("/", maxsplit=1)[-1]: name for name, ref in actions["discriminator"]["mapping"].items()}
    parts: list[str] = []
    for kind in ACTIONS:
        parts.append(f"### {code(name_of[kind.__name__])}\n\n{sentence(getdoc(kind) or '')}\n")
        parts += tables_of("events", kind.__name__, actions["discriminator"]["propertyName"], seen)
    return "\n".join(parts)
