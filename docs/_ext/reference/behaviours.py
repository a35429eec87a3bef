"""The behaviours that come with swarmwire: a table of all, and what each does, needs and takes."""

import re
import tomllib
from inspect import cleandoc
from pathlib import Path
from typing import Any

from reference.docstrings import told_of
from reference.field_comments import comments_of
from reference.markdown import code, table, toml_code
from swarmwire.agent import behaviours
from swarmwire.agent.parameters import REQUIRED, parameters_of
from swarmwire.agent.vector_agent import VectorAgent

SCENARIOS = Path(__file__).parents[3] / "scenarios" / "behaviours"
ALL_HEAD = ("behaviour", "what it does", "by radio", "needs")
HEAD = ("parameter", "default", "meaning")


def behaviour_table() -> str:
    """A row for each behaviour, with a link to its page."""
    rows: list[tuple[str, ...]] = []
    for name in behaviours.__all__:
        kind: Any = getattr(behaviours, name)
        about = cleandoc(kind.__doc__).partition("\n")[0]
        rows.append(
            (f"[{name}](behaviours/{page_of(kind)}.md)", about, "yes" if _by_radio(kind) else "no", _needs(kind))
        )
    return table(ALL_HEAD, rows)


def behaviour_details(name: str) -> str:
    """One behaviour: its docstring, what it needs, its parameters; other pages can name its class."""
    kind: Any = getattr(behaviours, name)
    agent = code(f'agent = "swarmwire.agent.behaviours:{name}"')
    target = f"```{{py:class}} swarmwire.agent.behaviours.{name}\n:canonical: {kind.__module__}.{name}\n"
    parts = [
        f"{target}:no-typesetting:\n```\n",
        f"{agent}\n",
        f"{told_of(kind, VectorAgent)}\n",
        f"Needs {_needs(kind)}.\n",
    ]
    meant = comments_of(kind)
    rows = [(code(key), _default(of.default), meant.get(key, "")) for key, of in parameters_of(kind).items()]
    parts += [table(HEAD, rows)] if rows else []
    return "\n".join(parts)


def page_of(kind: type[Any]) -> str:
    """The name of a behaviour's page, and of its scenario: PsoSearch's is pso_search."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower()


def _by_radio(kind: type[Any]) -> bool:
    scenario = SCENARIOS / f"{page_of(kind)}.toml"
    return "radio" in tomllib.loads(scenario.read_text(encoding="utf-8"))


def _needs(kind: Any) -> str:
    return ", ".join(code(need) for need in kind.needs) or "nothing"


def _default(value: object) -> str:
    return "required" if value is REQUIRED else toml_code(value)
