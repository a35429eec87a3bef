"""Versions of what stands in a run folder: another one is refused. Something that is added keeps the version."""

from pathlib import Path
from typing import cast

from swarmwire.comms.format_number import check_format

SUMMARY_FORMAT = 1  # of summary.json
RUN_FORMAT = 1  # of run.json
TABLES_FORMAT = 2  # of static.json, which has it, and of the tables


def refuse_other_format(written: object, known: int, path: Path) -> None:
    """Return if what a file holds names the known format, or none; BadInput if it names another.

    Whether one must be named is up to who reads the rest of the file.
    """
    if isinstance(written, dict):
        check_format(cast("dict[str, object]", written).get("format", known), known, str(path))
