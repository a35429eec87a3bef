"""The run folder."""

import re
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput


def make_folder(out: Path | None, scenario: str, seeds: tuple[int, ...]) -> Path:
    """The folder of a run, which must be new or empty; by default runs/<scenario>-s<seed>-<UTC>. BadInput otherwise."""
    if out is None:
        slug = re.sub(r"[^a-z0-9]+", "-", scenario.lower()).strip("-") or "run"
        seed = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]}to{seeds[-1]}"
        out = Path("runs") / f"{slug}-s{seed}-{WallClock().utc_stamp()}"
    try:
        out.mkdir(parents=True, exist_ok=True)
        empty = not any(out.iterdir())
    except OSError as error:
        raise BadInput("--out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    if not empty:
        raise BadInput("--out", str(out), "expected a new or empty folder")
    return out
