"""Whether the recording for the viewer can be read, and how far it reaches."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from swarmwire.metrics.finding import State


def check_recording(path: Path) -> tuple[State, str]:
    """Read a .rrd to its end; without rerun-sdk only that it is there."""
    megabytes = f"{path.stat().st_size / 1e6:.1f} MB"
    if find_spec("rerun") is None or find_spec("rerun_bindings") is None:
        return State.WHOLE, f"{megabytes}, not read: that needs rerun-sdk (swarmwire-metrics[view])"
    import rerun as rr

    try:
        reader: Any = rr.chunk.RrdReader(str(path))
        last = max((tick for chunk in reader.stream() if (tick := _last_tick(chunk)) is not None), default=None)
    except Exception as error:  # noqa: BLE001 - rerun promises no type; whatever it is, the file is unreadable
        return State.DAMAGED, str(error).splitlines()[0]
    if last is None:
        return State.PARTIAL, f"{megabytes}, no tick in it"
    if not _has_footer(reader):
        return State.PARTIAL, f"{megabytes}, readable up to tick {last}; it was never closed"
    return State.WHOLE, f"{megabytes}, up to tick {last}"


def _last_tick(chunk: Any) -> int | None:
    batch = chunk.to_record_batch()
    return max(batch["tick"].to_pylist(), default=None) if "tick" in batch.schema.names else None


def _has_footer(reader: Any) -> bool:
    """Whether the file was closed: only then does it have an index."""
    try:
        reader.store()
    except Exception:  # noqa: BLE001 - rerun promises no type
        return False
    return True
