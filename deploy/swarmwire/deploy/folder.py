"""The run folder."""

from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput


def default_folder(scenario: str, seeds: tuple[int, ...]) -> Path:
    """runs/<scenario>-s<seed>-<UTC>."""
    seed = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]}to{seeds[-1]}"
    return Path("runs") / f"{scenario}-s{seed}-{WallClock().utc_stamp()}"


def make_folder(out: Path) -> Path:
    """The run folder, made if need be; BadInput unless it is new or empty."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        empty = not any(out.iterdir())
    except OSError as error:
        raise BadInput("--out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    if not empty:
        raise BadInput("--out", str(out), "expected a new or empty folder")
    return out


def write_whole(path: Path, text: str) -> None:
    """Write a file aside first, then rename it, so that no half of it is ever seen."""
    aside = path.with_suffix(".part")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)
