"""What stands in a run folder beside the summary: the columns of its tables, and the fields of its JSON files."""

from dataclasses import asdict
from typing import Any

from swarmwire.comms.truth import Static
from swarmwire.deploy.record.provenance import RunFacts
from tests.tools.stable.recorded_run import recorded
from tests.tools.stable.samples import LEFT_OUT, joined, lines_of, paths_of, sample

TYPES = {"run.json": RunFacts, "static.json": Static}  # of what they hold beside `format`


def text() -> str:
    """A file a paragraph."""
    parts: list[str] = []
    for name, held in recorded().items():
        if name in TYPES:
            parts.append(f"# {name}, format {held['format']}\n{lines_of(_fields(TYPES[name]))}")
        elif name.endswith(".parquet"):
            columns = "".join(f"{column}: {kind}\n" for column, kind in held.items())
            parts.append(f"# {name}\n{columns}")
    return "\n".join(parts)


def _fields(kind: type[Any]) -> dict[str, set[str]]:
    made_up = (asdict(sample(kind, left_out)) for left_out in LEFT_OUT)
    return joined({"format": {"whole number"}}, *map(paths_of, made_up))
