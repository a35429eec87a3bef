"""Trial: which robots, for how long, with what parameters."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms import draws
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.bodies.custom import CustomSensorSpec
from swarmwire.comms.bodies.drives import BRIGHTEST
from swarmwire.comms.bodies.sensor_specs import CameraSpec, GroundSpec
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.packets import (
    NO_TX_STATUSES,
    NOT_MEASURED,
    Payloads,
    ReceivedPackets,
    SentPackets,
    TxResult,
    TxStatuses,
)
from swarmwire.comms.tick_io import GroupReadings


@dataclass(frozen=True)
class Trial:
    """What to try an agent with: robots whose senses and packets are made up.

    All that the body senses is drawn anew in each tick. What robots send is received a tick later, by each of the
    others with probability 0.4, and tx statuses of all kinds are told to an agent that needs them. A tenth of the
    robots is missing in each tick and starts afresh when it is back.
    """

    robots: int = 7  # of one group
    ticks: int = 12  # of a tenth of a second
    seed: int = 1  # of what they sense, hear and draw
    body: str | Body = "epuck"  # one that comes with swarmwire, or any other
    params: dict[str, Any] | None = None  # as in a scenario: a list has a value for each robot

    @cached_property
    def spec(self) -> Body:
        """The body's data sheet."""
        return load_body(self.body) if isinstance(self.body, str) else self.body


# --- What robots of a trial sense and hear, made up and keyed by its seed.
#
# Ragged packets (what robots sent a tick ago, received by some), tx statuses of addressed ones, robots that drop out
# and come back.


RATE_HZ = 10
GIVEN = ("range_m", "bearing_rad", "rssi_dbm")
DROP_OUT = 0.1  # share of the robots missing in a tick
HEARING = 0.4  # share of the senders that a robot hears
LEARNING = 0.6  # share of the tx statuses still to come that come in a tick


class _Ether:
    """What was sent a tick ago, received at random, and what became of it, told at random."""

    def __init__(self, key: int) -> None:
        self._key, self._sent = key, SentPackets.none()
        self._untold = NO_TX_STATUSES

    def show(self, sent: SentPackets) -> None:
        self._sent = sent.select(np.argsort(sent.sender, kind="stable"))
        asked = np.flatnonzero(self._sent.tx_status_ids != NOT_MEASURED)
        row, id_ = self._sent.sender[asked], self._sent.tx_status_ids[asked]
        chance = draws.uniform(self._key, row, id_, 0, draws.purpose("outcome"))
        new = TxStatuses(row, id_, (chance * len(TxResult)).astype(np.int64))
        self._untold = TxStatuses.joined([self._untold, new])

    def tx_status(self, tick: int) -> TxStatuses:
        """As the medium would tell them: also to robots that have dropped out, and to those that have forgotten."""
        comes = _uniform(self._key, tick, "learning", (len(self._untold),)) < LEARNING
        told, self._untold = (self._untold.select(np.flatnonzero(now)) for now in (comes, ~comes))
        return told

    def received(self, tick: int, rows: IntArray) -> ReceivedPackets:
        chance = _uniform(self._key, tick, "hearing", (len(rows), len(self._sent)))
        receiver, payload = np.nonzero((chance < HEARING) & (self._sent.sender != rows[:, None]))
        given = {name: _uniform(self._key, tick, name, (len(receiver),)) * 3.0 - 1.0 for name in GIVEN}
        at_ns = np.full(len(receiver), tick_start_ns(tick, RATE_HZ) - 1, np.int64)
        sender = self._sent.sender[payload]
        payloads: Payloads = self._sent.payloads
        return ReceivedPackets(rows[receiver], sender, np.full(len(receiver), tick), at_ns, given, payload, payloads)


class SyntheticInputs(NamedTuple):
    """What a group is given in a tick: time (its number, start and length in ns), senses, packets and tx statuses."""

    time: tuple[int, int, int]
    readings: GroupReadings
    received: ReceivedPackets
    tx_status: TxStatuses


def inputs(trial: Trial) -> Iterator[tuple[SyntheticInputs, Callable[[SentPackets], None]]]:
    """What the robots are given, tick by tick, and whom to show what they sent."""
    key, body = draws.derive_key("inputs", trial.seed), trial.spec
    ether = _Ether(key)
    for tick in range(trial.ticks):
        rows = np.flatnonzero(_uniform(key, tick, "drop-out", (trial.robots,)) >= DROP_OUT)
        time_ns = tick_start_ns(tick, RATE_HZ)
        time = (tick, time_ns, tick_start_ns(tick + 1, RATE_HZ) - time_ns)
        sensors = GroupReadings(rows, _readings(body, key, tick, rows))
        yield SyntheticInputs(time, sensors, ether.received(tick, rows), ether.tx_status(tick)), ether.show


def _readings(body: Body, key: int, tick: int, rows: IntArray) -> dict[str, FloatArray]:
    n, fields = len(rows), dict[str, FloatArray]()
    if body.proximity is not None:
        value = _uniform(key, tick, "proximity", (n, len(body.proximity.angles_deg)))
        fields["proximity.value"] = np.maximum(value * 2.0 - 1.0, 0.0)
    if body.compass is not None:
        fields["compass.heading_rad"] = (_uniform(key, tick, "compass", (n,)) * 2.0 - 1.0) * np.pi
    if body.odometry is not None:
        for side in ("left_m", "right_m"):
            fields[f"odometry.{side}"] = tick * 0.01 + _uniform(key, tick, side, (n,)) * 0.01
    if body.light is not None:
        fields["light.value"] = _uniform(key, tick, "light", (n, len(body.light.angles_deg)))
    if "bumper" in body.sensors:
        fields["bumper.pressed"] = np.round(_uniform(key, tick, "bumper", (n,)))
    if "positioning" in body.sensors:
        for axis in ("x_m", "y_m"):
            fields[f"positioning.{axis}"] = _uniform(key, tick, axis, (n,)) * 4.0 - 2.0
    if "imu" in body.sensors:
        for name in ("forward_mps2", "left_mps2", "turn_radps"):
            fields[f"imu.{name}"] = _uniform(key, tick, name, (n,)) * 2.0 - 1.0
    if "battery" in body.sensors:
        charge = _uniform(key, tick, "battery", (n,))
        fields["battery.charge"], fields["battery.voltage_v"] = charge, 3.4 + 0.8 * charge
    for name, spec in body.sensors.items():
        if isinstance(spec, CustomSensorSpec):
            for field, width in spec.fields.items():
                fields[f"{name}.{field}"] = _uniform(key, tick, f"{name}.{field}", (n, width) if width else (n,))
    fields.update(_seen(body, key, tick, n))
    return fields


def _seen(body: Body, key: int, tick: int, n: int) -> dict[str, FloatArray]:
    """What senses show that look around or down."""
    fields = dict[str, FloatArray]()
    if body.infrared is not None:
        value = _uniform(key, tick, "infrared", (n, len(body.infrared.angles_deg)))
        fields["infrared.value"] = np.maximum(value * 2.0 - 1.0, 0.0)
    if body.scan is not None:
        share = _uniform(key, tick, "scan", (n, body.scan.rays))
        fields["scan.range_m"] = np.where(share < 0.8, share * body.scan.range_m, np.inf)
    ground, camera = body.sensors.get("ground"), body.sensors.get("camera")
    if isinstance(ground, GroundSpec):
        fields["ground.shade"] = _uniform(key, tick, "ground", (n, len(ground.points_m)))
    if isinstance(camera, CameraSpec):
        shape = n, camera.most_blobs
        none = np.arange(camera.most_blobs) >= _uniform(key, tick, "blobs", (n, 1)) * camera.most_blobs
        nearest_first = np.sort(_uniform(key, tick, "distance", shape), axis=1)
        bearing = (_uniform(key, tick, "bearing", shape) * 2.0 - 1.0) * np.pi
        colour = np.floor(_uniform(key, tick, "colour", shape) * BRIGHTEST)
        for name, column in (("distance_m", nearest_first), ("bearing_rad", bearing), ("colour", colour)):
            fields[f"camera.{name}"] = np.where(none, np.nan, column)
    return fields


def _uniform(key: int, tick: int, purpose: str, shape: tuple[int, ...]) -> FloatArray:
    count = np.arange(int(np.prod(shape))).reshape(shape)
    return draws.uniform(key, tick, count, 0, draws.purpose(purpose))
