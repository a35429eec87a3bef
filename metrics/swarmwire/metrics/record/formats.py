"""Versions of what stands in a run folder: another one is refused. Something that is added keeps the version."""

from pathlib import Path
from typing import cast

from swarmwire.comms.errors import BadInput

SUMMARY_FORMAT = 1  # of summary.json
RUN_FORMAT = 1  # of run.json
TABLES_FORMAT = 2  # of static.json, which has it, and of the tables


def refuse_other_format(written: object, known: int, path: Path) -> None:
    """Return if the mapping that a file holds names the known format; BadInput if it names another, or none.

    What is no mapping at all is left to who reads it: it is damaged, not of another version.
    """
    if isinstance(written, dict):
        found = cast("dict[str, object]", written).get("format")
        if type(found) is not int or found != known:
            got = "nothing" if found is None else repr(found)
            raise BadInput(str(path), "format", f"expected {known}, got {got}: by another version of swarmwire")
