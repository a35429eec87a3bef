"""One arena of several, as if it were the only one: robot rows become indices."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.tick_io import GroupReadings, Readings
from swarmwire.comms.truth import PacketCounts, ReceptionRecords, Static, TransmissionRecords, Truth


def static_of(static: Static, arena: int) -> Static:
    """What does not change in this arena."""
    one = slice(arena, arena + 1)
    return replace(static, seeds=static.seeds[one], obstacles=static.obstacles[one], lights=static.lights[one])


def truth_of(truth: Truth, static: Static, arena: int) -> Truth:
    """A tick of this arena; `static` is that of all."""
    if static.arenas == 1:
        return truth
    rows = slice(arena * static.robots, (arena + 1) * static.robots)
    within = readings_within(truth.readings, rows)
    readings = {name: GroupReadings(group.rows - rows.start, group.fields) for name, group in within.items()}
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
        tally=None if tally is None else _tally_of(tally, arena),
        finished=None if finished is None else _finished_of(finished, arena),
        events=tuple(replace(event, changed=event.changed[rows]) for event in truth.events),
        departed=None if departed is None else _departed_of(departed, arena),
        movable=None if movable is None else movable[arena : arena + 1],
        value=None if value is None else value[rows],
    )


def readings_within(readings: Readings, rows: slice) -> Readings:
    """The senses of these robots alone."""
    found: Readings = {}
    for name, group in readings.items():
        first, last = np.searchsorted(group.rows, [rows.start, rows.stop])
        if first < last:
            columns = {sensor: column[first:last] for sensor, column in group.fields.items()}
            found[name] = GroupReadings(group.rows[first:last], columns)
    return found


def _tally_of(tally: PacketCounts, arena: int) -> PacketCounts:
    one = slice(arena, arena + 1)
    return PacketCounts(tally.sent[one], tally.intended[one], tally.in_range[one], tally.fates[one])


def _finished_of(finished: ReceptionRecords, arena: int) -> ReceptionRecords:
    own = finished.arena == arena
    columns: dict[str, Any] = {field.name: getattr(finished, field.name) for field in fields(ReceptionRecords)}
    payloads = columns.pop("payloads")
    kept: dict[str, Any] = {name: None if column is None else column[own] for name, column in columns.items()}
    return ReceptionRecords(**{**kept, "arena": np.zeros_like(kept["arena"])}, payloads=payloads)


def _departed_of(departed: TransmissionRecords, arena: int) -> TransmissionRecords:
    own = departed.arena == arena
    kept: dict[str, Any] = {field.name: getattr(departed, field.name)[own] for field in fields(TransmissionRecords)}
    return TransmissionRecords(**{**kept, "arena": np.zeros_like(kept["arena"])})


# --- A run as those see it who look on from another process: some of its ticks, and the numbers measured so far.


@dataclass(frozen=True, slots=True)
class MetricSeries:
    """A metric whose values come with each glimpse."""

    name: str
    unit: str
    bounds: tuple[float | None, float | None]  # least and largest value of a tick; None: there is none


@dataclass(frozen=True, slots=True)
class ObservedRun:
    """What a run tells once to whoever begins to look on."""

    static: Static
    series: tuple[MetricSeries, ...]
    selected: str  # the robot that is shown in detail


@dataclass(frozen=True, slots=True)
class ObservedTick:
    """One tick, with what happened in the ticks since the glimpse before.

    `truth` is the state of its tick; its contact onsets, tally and events are those of the last `ticks` ticks together.
    Edges, finished links and senses may be left out (None, None, {}), as they are large.
    """

    truth: Truth
    serial: int  # how many glimpses went before; what is left out in between was lost on the way
    ticks: int  # at least 1
    values: FloatArray  # (series, arenas) latest value of each metric
