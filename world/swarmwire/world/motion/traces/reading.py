"""Files of motion traces; the suffix of the name chooses the format, or a file in a folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.bags import METADATA
from swarmwire.world.motion.traces import bonnmotion, emane, ns2, rosbag, run_folder, table
from swarmwire.world.motion.traces.emane import Origin
from swarmwire.world.motion.traces.trace import MotionTrace

EEL = ".eel"
FORMATS: Mapping[str, Any] = {  # modules with `read` and `write`; rosbag has no `write`
    ".movements": bonnmotion,
    ".movements.gz": bonnmotion,
    ".tcl": ns2,
    ".ns_movements": ns2,
    ".setdest": ns2,
    EEL: emane,
    ".csv": table,
    ".parquet": table,
    ".mcap": rosbag,
    ".db3": rosbag,
}
FOLDER_FORMATS: Mapping[str, Any] = {  # by a file in the folder; modules with `read` and `files`
    run_folder.STATIC: run_folder,
    METADATA: rosbag,
}


def read_trace(path: Path, *, origin: Origin | None = None) -> MotionTrace:
    """Read a trace; `origin`: latitude and longitude in degrees and height in m of the point (0, 0, 0), for `.eel`.

    BadInput for a file that cannot be read, and for its first fault.
    """
    if path.is_dir():
        return _folder_format(path).read(path)
    suffix = suffix_of(path)
    if suffix != EEL:
        return FORMATS[suffix].read(path)
    if origin is None:
        expected = "expected an origin: latitude and longitude in degrees and height in m of the point (0, 0, 0)"
        raise BadInput(str(path), "", expected)
    return emane.read(path, origin)


def files_of(folder: Path) -> list[Path]:
    """Return the files of a folder that its trace needs; BadInput if it has no trace."""
    return _folder_format(folder).files(folder)


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


def _folder_format(folder: Path) -> Any:
    """Return the module that reads a folder; BadInput if there is none."""
    for name, module in FOLDER_FORMATS.items():
        if (folder / name).is_file():
            return module
    expected = f"expected the folder of a run, with {run_folder.STATIC}, or of a bag, with {METADATA}"
    raise BadInput(str(folder), "", expected)
