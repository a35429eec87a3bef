"""Whether the recording for the viewer can be read, and how far it reaches."""

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swarmwire.comms.extras import VIEW
from swarmwire.metrics.run_folder.table import State

FILE_HEADER_BYTES = 12  # of a .rrd: magic, version, options
FRAME_HEADER_BYTES = 16  # kind, and the payload's length in the last 8, little-endian


def check_recording(path: Path, has_ticks: bool = True) -> tuple[State, str]:
    """Read a .rrd to its end; without rerun-sdk only that it is there. A run that `has_ticks` shows one at least."""
    megabytes = f"{path.stat().st_size / 1e6:.1f} MB"
    if VIEW.missing():
        return State.INTACT, f"{megabytes}, not read: that needs {VIEW.requirement}"
    try:
        last, closed = _read_all(path)
    except Exception as error:  # noqa: BLE001 - rerun promises no type; whatever it is, the file is unreadable
        return State.DAMAGED, str(error).splitlines()[0]
    reach = "no tick in it" if last is None else f"up to tick {last}"
    if not closed:
        return State.PARTIAL, f"{megabytes}, readable {reach}; it was never closed"
    return State.PARTIAL if last is None and has_ticks else State.INTACT, f"{megabytes}, {reach}"


def _read_all(path: Path) -> tuple[int | None, bool]:
    """As `_read`; where rerun's reader refuses a file whose last frame is cut off, up to that frame."""
    try:
        return _read(path)
    except RuntimeError as refused:
        with TemporaryDirectory() as folder, path.open("rb") as whole:
            start = Path(folder) / path.name
            start.write_bytes(whole.read(_whole_frames_bytes(path)))
            try:
                return _read(start)[0], False
            except RuntimeError:
                raise refused from None  # what it said of the file itself counts


def _whole_frames_bytes(path: Path) -> int:
    """Where the frame begins that the file cuts off, as the end of a run that was killed may."""
    size, at = path.stat().st_size, FILE_HEADER_BYTES
    with path.open("rb") as file:
        while at + FRAME_HEADER_BYTES <= size:
            file.seek(at + 8)
            end = at + FRAME_HEADER_BYTES + int.from_bytes(file.read(8), "little")
            if end > size:
                break
            at = end
    return at


def _read(path: Path) -> tuple[int | None, bool]:
    """The last tick in a recording, and whether it was closed: only then does it have an index."""
    import rerun as rr

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it takes a file without an index for one of an old version
        reader: Any = rr.chunk.RrdReader(str(path))
        last = max((tick for chunk in reader.stream() if (tick := _last_tick(chunk)) is not None), default=None)
        try:
            reader.store()
        except Exception:  # noqa: BLE001 - rerun promises no type
            return last, False
    return last, True


def _last_tick(chunk: Any) -> int | None:
    batch = chunk.to_record_batch()
    return max(batch["tick"].to_pylist(), default=None) if "tick" in batch.schema.names else None
