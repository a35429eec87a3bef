"""Views of a run: one of several arenas, and the frames of a live observer.

`static_of` and `truth_of` cut out one arena as if it were the only arena: robot rows become indices. A live observer,
in another process, gets an `ObservedRun` once and an `ObservedTick` for some of the ticks.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.tick_io import GroupReadings, Readings


def static_of(static: Static, arena: int) -> Static:
    """Return the `Static` of one arena."""
    index = slice(arena, arena + 1)
    return replace(static, seeds=static.seeds[index], obstacles=static.obstacles[index], lights=static.lights[index])


def truth_of(truth: Truth, static: Static, arena: int) -> Truth:
    """Return the tick of one arena; `static` is that of all arenas."""
    if static.arenas == 1:
        return truth
    rows = slice(arena * static.robots, (arena + 1) * static.robots)
    arena_readings = readings_within(truth.readings, rows)
    readings = {name: GroupReadings(group.rows - rows.start, group.fields) for name, group in arena_readings.items()}
    edges, tally, finished, departed = truth.edges, truth.tally, truth.finished, truth.departed
    movable, value = truth.movable, truth.value
    if edges is not None:
        edges = edges[(edges[:, 0] >= rows.start) & (edges[:, 0] < rows.stop)] - rows.start
    return replace(
        truth,
        running=truth.running[arena : arena + 1],
        alive=truth.alive[rows],
        pose=truth.pose[rows],
        velocity=truth.velocity[rows],
        command=truth.command[rows],
        state=truth.state[rows],
        leds=truth.leds[rows],
        readings=readings,
        contact_onsets=truth.contact_onsets[arena : arena + 1],
        edges=edges,
        tally=None if tally is None else _counts_of(tally, arena),
        finished=None if finished is None else _receptions_of(finished, arena),
        events=tuple(replace(event, changed=event.changed[rows]) for event in truth.events),
        departed=None if departed is None else _transmissions_of(departed, arena),
        movable=None if movable is None else movable[arena : arena + 1],
        value=None if value is None else value[rows],
    )


def readings_within(readings: Readings, rows: slice) -> Readings:
    """Return the readings of the robots in these rows."""
    selected: Readings = {}
    for name, group in readings.items():
        first, last = np.searchsorted(group.rows, [rows.start, rows.stop])
        if first < last:
            columns = {sensor: column[first:last] for sensor, column in group.fields.items()}
            selected[name] = GroupReadings(group.rows[first:last], columns)
    return selected


def _counts_of(tally: PacketCounts, arena: int) -> PacketCounts:
    index = slice(arena, arena + 1)
    return PacketCounts(tally.sent[index], tally.intended[index], tally.in_range[index], tally.fates[index])


def _receptions_of(finished: ReceptionRecords, arena: int) -> ReceptionRecords:
    in_arena = finished.arena == arena
    columns: dict[str, Any] = {field.name: getattr(finished, field.name) for field in fields(ReceptionRecords)}
    payloads = columns.pop("payloads")
    selected: dict[str, Any] = {name: None if column is None else column[in_arena] for name, column in columns.items()}
    return ReceptionRecords(**{**selected, "arena": np.zeros_like(selected["arena"])}, payloads=payloads)


def _transmissions_of(departed: TransmissionRecords, arena: int) -> TransmissionRecords:
    in_arena = departed.arena == arena
    selected: dict[str, Any] = {
        field.name: getattr(departed, field.name)[in_arena] for field in fields(TransmissionRecords)
    }
    return TransmissionRecords(**{**selected, "arena": np.zeros_like(selected["arena"])})


@dataclass(frozen=True, slots=True)
class MetricSeries:
    """A metric with a value in each `ObservedTick`."""

    name: str
    unit: str
    bounds: tuple[float | None, float | None]  # smallest and largest possible value; None: no bound


@dataclass(frozen=True, slots=True)
class ObservedRun:
    """The constant facts of a run, sent once to each live observer."""

    static: Static
    series: tuple[MetricSeries, ...]
    selected: str  # name of the robot that is shown in detail


@dataclass(frozen=True, slots=True)
class ObservedTick:
    """One tick for live observers, with the events and counts since the previous `ObservedTick`.

    `truth` is the state of its tick; its contact onsets, tally and events are sums over the last `ticks` ticks. Edges,
    finished receptions and readings are large and may be left out (None, None, {}).
    """

    truth: Truth
    serial: int  # number of earlier `ObservedTick`s; a gap is a loss on the network
    ticks: int  # number of ticks since the previous `ObservedTick`, at least 1
    values: FloatArray  # (series, arenas) latest value of each metric
