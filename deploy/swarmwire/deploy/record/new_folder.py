"""The run folder."""

from itertools import chain, count
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.run_folder.layout import LOG


def default_folder(scenario: str, seeds: tuple[int, ...]) -> Path:
    """runs/<scenario>-s<seed>-<UTC>, as `stamped_folder` has it."""
    seed = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]}to{seeds[-1]}"
    return stamped_folder(Path("runs") / f"{scenario}-s{seed}")


def stamped_folder(name: Path) -> Path:
    """<name>-<UTC>, with a number behind it if somebody has taken that in the same second."""
    wanted = name.with_name(f"{name.name}-{WallClock().utc_stamp()}")
    numbered = (wanted.with_name(f"{wanted.name}-{number}") for number in count(2))
    return next(folder for folder in chain([wanted], numbered) if not folder.exists())


def make_folder(out: Path) -> Path:
    """The run folder, made if need be and taken by its log; BadInput unless it is new or empty."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        taken = any(out.iterdir()) or not _claim(out)
    except OSError as error:
        raise BadInput("--out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    if taken:
        raise BadInput("--out", str(out), "expected a new or empty folder")
    return out


def _claim(folder: Path) -> bool:
    """Whether this run is the first there: of several that found it empty, the system lets one alone make the log."""
    try:
        (folder / LOG).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True
