"""Files of motion traces; the suffix of the name chooses the format."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.traces import bonnmotion, emane, mcap, ns2, table
from swarmwire.world.motion.traces.emane import Origin
from swarmwire.world.motion.traces.trace import MotionTrace

EEL = ".eel"
FORMATS: Mapping[str, Any] = {  # modules with `read` and `write`; mcap has no `write`
    ".movements": bonnmotion,
    ".movements.gz": bonnmotion,
    ".tcl": ns2,
    ".ns_movements": ns2,
    ".setdest": ns2,
    EEL: emane,
    ".csv": table,
    ".parquet": table,
    ".mcap": mcap,
}


def read_trace(path: Path, *, origin: Origin | None = None) -> MotionTrace:
    """Read a trace; `origin`: latitude and longitude in degrees and height in m of the point (0, 0, 0), for `.eel`.

    BadInput for a file that cannot be read, and for its first fault.
    """
    suffix = suffix_of(path)
    if suffix != EEL:
        return FORMATS[suffix].read(path)
    if origin is None:
        expected = "expected an origin: latitude and longitude in degrees and height in m of the point (0, 0, 0)"
        raise BadInput(str(path), "", expected)
    return emane.read(path, origin)


def write_trace(path: Path, trace: MotionTrace, *, origin: Origin = (0.0, 0.0, 0.0)) -> None:
    """Write a trace; OSError if the file cannot be written."""
    suffix = suffix_of(path)
    if suffix == EEL:
        emane.write(path, trace, origin)
    else:
        FORMATS[suffix].write(path, trace)


def suffix_of(path: Path) -> str:
    """Return the suffix that chooses the format; BadInput if there is no format."""
    for suffix in FORMATS:
        if path.name.lower().endswith(suffix):
            return suffix
    raise BadInput(str(path), "", f"expected a file name that ends in {', '.join(FORMATS)}")
