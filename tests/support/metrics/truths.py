"""Truth made by hand: what a test does not name is a robot at rest, alive, without a radio."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.truth import Group, Light, Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric


def static(
    robots: int = 4,
    arenas: int = 1,
    radio: bool = True,
    obstacles: Sequence[Obstacle] = (),
    lights: Sequence[Sequence[Light]] = (),
    body: Body | None = None,
) -> Static:
    return Static(
        name="test",
        seeds=tuple(range(1, arenas + 1)),
        rate_hz=10,
        arena_size_m=(8.0, 6.0),
        boundary="walls",
        obstacles=(tuple(obstacles),) * arenas,
        groups=(Group("flock", body or load_body("epuck"), 0, robots),),
        robot_names=tuple(f"flock-{i}" for i in range(robots)),
        range_m=2.0 if radio else None,
        lights=tuple(map(tuple, lights)),
    )


def truth(run: Static, tick: int = 0, **values: Any) -> Truth:
    rows = run.arenas * run.robots
    fields: dict[str, Any] = {
        "tick": tick,
        "time_ns": tick * 100_000_000,
        "running": np.ones(run.arenas, np.bool_),
        "alive": np.ones(rows, np.bool_),
        "pose": np.zeros((rows, 3)),
        "velocity": np.zeros((rows, 3)),
        "command": np.zeros((rows, 3)),
        "state": np.zeros(rows, np.int64),
        "states": ("",),
        "leds": np.zeros((rows, run.max_leds), np.int64),
        "readings": {},
        "contact_onsets": np.zeros((run.arenas, 2), np.int64),
        "edges": None,
        "tally": None,
        "finished": None,
    }
    return Truth(**{**fields, **values})


def poses(heading_rad: Sequence[float]) -> np.ndarray[Any, Any]:
    pose = np.zeros((len(heading_rad), 3))
    pose[:, 2] = heading_rad
    return pose


def edges(*pairs: tuple[int, int]) -> np.ndarray[Any, Any]:
    return np.array(pairs, np.int64).reshape(-1, 2)


def tally(*fates: Mapping[Fate, int], sent: int = 1) -> PacketCounts:
    """A row per mapping; every fate but out_of_range counts as in range."""
    table = np.zeros((len(fates), len(Fate)), np.int64)
    for arena, counts in enumerate(fates):
        for fate, count in counts.items():
            table[arena, fate] = count
    intended = table.sum(axis=1)
    return PacketCounts(np.full(len(fates), sent, np.int64), intended, intended - table[:, Fate.OUT_OF_RANGE], table)


def finished(sent_at_ns: Sequence[int], final_at_ns: Sequence[int], fate: Fate = Fate.RECEIVED) -> ReceptionRecords:
    sent, final = np.array(sent_at_ns, np.int64), np.array(final_at_ns, np.int64)
    zero = np.zeros(len(sent), np.int64)
    return ReceptionRecords(zero, zero, zero + 1, zero + 1, zero - 1, zero, sent, sent, final, zero + fate, zero, zero)


def watch(run: Static, ticks: Iterable[Truth], *observers: Any) -> None:
    """Each of them begins, and sees each tick in their order."""
    for observer in observers:
        observer.begin(run)
    for truth in ticks:
        for observer in observers:
            observer.see(truth)


def in_each_tick(run: Static, ticks: Iterable[Truth], *metrics: Metric | str) -> np.ndarray[Any, Any]:
    """What the metrics say, (ticks, metrics, arenas)."""
    observer, values = Metrics(metrics), list[np.ndarray[Any, Any]]()
    observer.begin(run)
    for truth in ticks:
        observer.see(truth)
        values.append(np.array(list(observer.latest.values())))
    return np.array(values)


def measured(name: str, run: Static, truth: Truth) -> list[float]:
    """The metric's value in this one tick, per arena."""
    return in_each_tick(run, [truth], name)[0, 0].tolist()


def departed(
    sender: Sequence[int],
    intended: int = 3,
    out_of_range: int = 0,
    fate: Fate = Fate.RECEIVED,
    on_air_at_ns: int = 0,
    off_air_at_ns: int = 0,
    arena: int = 0,
) -> TransmissionRecords:
    """A packet of each of these senders."""
    columns = (arena, sender, BROADCAST, 0, intended, out_of_range, int(fate), on_air_at_ns, off_air_at_ns)
    return TransmissionRecords(*(np.array(column, np.int64) for column in np.broadcast_arrays(*columns)))
