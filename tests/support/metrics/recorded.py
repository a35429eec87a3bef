"""Recorded runs and their summaries, and files as a power cut or a worn disk leaves them."""

from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.table import RecordOptions
from swarmwire.metrics.records.run_folder.tables import record_summary, recorders
from tests.support.clocks import StillClock
from tests.support.metrics.truths import truth, watch


def record(folder: Path, run, ticks, **options):
    """Feed these ticks to all recorders of a run folder; the summary's `record`."""
    metrics = Metrics()
    observers = [metrics, *recorders(RecordOptions(folder, metrics, StillClock(), **options))]
    watch(run, ticks, *observers)
    parts = {}
    for observer in observers:
        parts.update(observer.end(None))
    return record_summary(parts)


def wandering(run, ticks, **fields):
    """Robots that are somewhere else in each tick, and named a state."""
    rng = np.random.default_rng(5)
    rows = run.arenas * run.robots
    states = ("", "search", "home")
    for tick in range(ticks):
        yield truth(
            run,
            tick,
            pose=rng.uniform(-3.0, 3.0, (rows, 3)),
            velocity=rng.normal(size=(rows, 3)),
            command=rng.normal(size=(rows, 3)),
            alive=rng.random(rows) < 0.8,
            state=rng.integers(0, 3 if tick else 1, rows),
            states=states if tick else states[:1],
            **fields,
        )


def links(
    sender, receiver, sequence, on_air_at_ns, fate=Fate.RECEIVED, arena=0, tag=0x1A2B, receivers=1, rssi_dbm=None, to=-1
):
    """Rows of `Finished`: lists or a number for all."""
    columns = np.broadcast_arrays(arena, sender, receiver, receivers, to, sequence, on_air_at_ns, fate, tag)
    arena, sender, receiver, receivers, to, sequence, on_air, fate, tag = (
        np.array(c, np.int64).ravel() for c in columns
    )
    sent, final, size = on_air - 1, on_air + 1000, np.full(len(sender), 10)
    return ReceptionRecords(
        arena, sender, receiver, receivers, to, sequence, sent, on_air, final, fate, size, tag, rssi_dbm
    )


def made_up_summary(ticks: int, *, arenas: int = 1, rate_hz: int = 10, **fields: Any) -> dict[str, Any]:
    """All that a summary holds, of a run that ended with its duration and measured nothing; `given` in place of it."""
    sim_time_s = ticks / rate_hz
    end = {"ended": "duration", "ticks": ticks, "sim_time_s": sim_time_s, "stop_time_s": None, "stopped_by": None}
    return {
        "format": 1,
        "scenario": "made-up",
        "arenas": arenas,
        "engine": "discs",
        "runners": 0,
        "mode": "local",
        "ended": "duration",
        "error": None,
        "ticks": ticks,
        "sim_time_s": sim_time_s,
        "wall_time_s": 0.5,
        "realtime_factor": 2.0,
        "realtime": None,
        "interfaces": None,
        "poses": [],
        "relay": [],
        "stop": [],
        "by_arena": [{**end, "counts": {}}] * arenas,
        "trajectory_sha256": [f"{arena:064x}" for arena in range(arenas)],
        "radio": None if arenas == 1 else [None] * arenas,
        "metrics": {} if arenas == 1 else [{}] * arenas,
        "events": [],
        "global_sensors": {},
        "counts": {},
        "lost_runners": [],
        "runner_events": [],
        "record": {},
        "cpu": "a CPU",
        "versions": {"numpy": "2"},
        "files": [],
        "inputs": None,
        "live_events": None,
        **fields,
    }


def damaged(parquet: bytes) -> st.SearchStrategy[bytes]:
    """A Parquet file that is cut off, or in which a few bits are turned: as often in its footer as anywhere."""
    last = len(parquet) - 1
    footer = len(parquet) - 8 - int.from_bytes(parquet[-8:-4], "little")
    index = st.integers(0, last) | st.integers(footer, last)
    turned = st.lists(st.tuples(index, st.integers(0, 7)), min_size=1, max_size=8).map(lambda at: _turned(parquet, at))
    return turned | turned | st.integers(0, last).map(lambda end: parquet[:end])


def _turned(data: bytes, bits: list[tuple[int, int]]) -> bytes:
    changed = bytearray(data)
    for index, bit in bits:
        changed[index] ^= 1 << bit
    return bytes(changed)
