"""Whether what a run folder keeps for its repetition is there, and as the summary says."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.config import check_format, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.record.formats import RUN_FORMAT
from swarmwire.metrics.record.names import DIGEST_BYTES, DIGESTS, INPUTS, RUN_JSON
from swarmwire.metrics.verify.finding import Finding, State


def check_run_json(folder: Path) -> Finding:
    """From what the run was made."""
    try:
        found: object = from_json((folder / RUN_JSON).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Finding(RUN_JSON, State.MISSING, "without it the run cannot be repeated")
    except (OSError, ValueError) as error:
        return Finding(RUN_JSON, State.DAMAGED, str(error))
    try:
        check_format(found, RUN_FORMAT, str(folder / RUN_JSON))
    except BadInput as error:
        return Finding(RUN_JSON, State.DAMAGED, f"{error.key}: {error.expected}")
    match found:
        case {"seeds": list(), "ticks": int(ticks)}:
            return Finding(RUN_JSON, State.INTACT, f"{ticks} ticks asked for")
        case _:
            return Finding(RUN_JSON, State.DAMAGED, "expected what swarmwire writes at the start of a run")


def check_digests(folder: Path, summary: Mapping[str, Any] | None) -> Finding:
    """A digest for each tick, the last that of the summary's hashes."""
    try:
        data = (folder / DIGESTS).read_bytes()
    except FileNotFoundError:
        return Finding(DIGESTS, State.MISSING, "without it a repetition is compared as a whole only")
    except OSError as error:
        return Finding(DIGESTS, State.DAMAGED, str(error))
    ticks = len(data) // DIGEST_BYTES
    if summary is None:
        return Finding(DIGESTS, State.PARTIAL, f"{ticks} ticks")
    if len(data) != DIGEST_BYTES * summary["ticks"]:
        return Finding(DIGESTS, State.DIFFERS, f"{ticks} ticks; the summary has {summary['ticks']}")
    last = hashlib.sha256("".join(summary["trajectory_sha256"]).encode()).digest()[:DIGEST_BYTES]
    if ticks and data[-DIGEST_BYTES:] != last:
        return Finding(DIGESTS, State.DIFFERS, "the last is not that of the summary's hashes")
    return Finding(DIGESTS, State.INTACT, f"{ticks} ticks")


def check_inputs(folder: Path, summary: Mapping[str, Any] | None) -> list[Finding]:
    """What came from outside, if anything did."""
    recorded: Mapping[str, Any] | None = None if summary is None else summary["inputs"]
    path = folder / INPUTS
    if not path.is_file():
        return [] if recorded is None else [Finding(INPUTS, State.MISSING, "without it the run cannot be repeated")]
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    if recorded is None:
        state = State.PARTIAL if summary is None else State.DIFFERS
        return [Finding(INPUTS, state, f"{path.stat().st_size} bytes, of which the summary says nothing")]
    if sha256 != recorded["sha256"]:
        return [Finding(INPUTS, State.DIFFERS, f"its sha256 is not {recorded['sha256'][:16]}…")]
    return [Finding(INPUTS, State.INTACT, f"{recorded['ticks']} ticks from {recorded['first_tick']} on")]
