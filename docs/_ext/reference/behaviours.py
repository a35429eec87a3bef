"""The behaviours that come with swarmwire: what each does, needs and takes."""

from typing import Any

from reference.docstrings import told_of
from reference.field_comments import comments_of
from reference.markdown import code, table, toml_code
from swarmwire.agent import behaviours
from swarmwire.agent.declared import REQUIRED, parameters_of
from swarmwire.agent.vector_agent import VectorAgent

HEAD = ("parameter", "default", "meaning")


def behaviour_table() -> str:
    """Every behaviour with its needs and parameters."""
    parts: list[str] = []
    for name in behaviours.__all__:
        kind: Any = getattr(behaviours, name)
        needs = ", ".join(code(need) for need in kind.needs) or "nothing"
        parts.append(
            f"### {code(f'swarmwire.agent.behaviours:{name}')}\n\n{told_of(kind, VectorAgent)}\n\nNeeds {needs}.\n"
        )
        meant = comments_of(kind)
        declared = parameters_of(kind).items()
        rows = [(code(key), _default(of.default), meant.get(key, "")) for key, of in declared]
        parts += [table(HEAD, rows)] if rows else []
    return "\n".join(parts)


def _default(value: object) -> str:
    return "required" if value is REQUIRED else toml_code(value)
