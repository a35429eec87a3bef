"""Synthetic readings, packets and tx statuses for a group of robots, keyed by a seed.

`inputs` yields them tick by tick: readings drawn anew, the packets that the robots sent a tick ago, each received by
some of the others, tx statuses of unicast packets, and robots that drop out and return.
"""

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

RATE_HZ = 10
MEASURES = ("range_m", "bearing_rad", "rssi_dbm")
DROP_OUT_SHARE = 0.1  # share of the robots missing in a tick
RECEPTION_SHARE = 0.4  # share of the senders that a robot receives
STATUS_SHARE = 0.6  # share of the outstanding tx statuses that arrive in a tick


@dataclass(frozen=True)
class Trial:
    """A test case for an agent: robots with synthetic readings and packets.

    All readings are drawn anew in each tick. A packet is received a tick later, by each of the others with probability
    0.4, and an agent that needs tx statuses gets all kinds of them. A tenth of the robots is missing in each tick and
    starts with defaults when it returns.
    """

    robots: int = 7  # of one group
    ticks: int = 12  # of a tenth of a second
    seed: int = 1  # of readings, reception and the robots' draws
    body: str | Body = "epuck"  # the name of a bundled body, or any body
    params: dict[str, Any] | None = None  # as in a scenario: a list has a value for each robot

    @cached_property
    def spec(self) -> Body:
        """The body with its specs."""
        return load_body(self.body) if isinstance(self.body, str) else self.body


class _Medium:
    """Delivers the packets of the last tick at random, and their tx statuses at random ticks."""

    def __init__(self, key: int) -> None:
        self._key, self._sent = key, SentPackets.none()
        self._outstanding = NO_TX_STATUSES

    def show(self, sent: SentPackets) -> None:
        self._sent = sent.select(np.argsort(sent.sender, kind="stable"))
        unicast = np.flatnonzero(self._sent.tx_status_ids != NOT_MEASURED)
        row, id_ = self._sent.sender[unicast], self._sent.tx_status_ids[unicast]
        chance = draws.uniform(self._key, row, id_, 0, draws.purpose("outcome"))
        new = TxStatuses(row, id_, (chance * len(TxResult)).astype(np.int64))
        self._outstanding = TxStatuses.joined([self._outstanding, new])

    def tx_status(self, tick: int) -> TxStatuses:
        """As from the radio medium: also for robots that are missing, and for those that started anew since."""
        arrives = _uniform(self._key, tick, "learning", (len(self._outstanding),)) < STATUS_SHARE
        now, self._outstanding = (self._outstanding.select(np.flatnonzero(mask)) for mask in (arrives, ~arrives))
        return now

    def received(self, tick: int, rows: IntArray) -> ReceivedPackets:
        chance = _uniform(self._key, tick, "hearing", (len(rows), len(self._sent)))
        receiver, payload = np.nonzero((chance < RECEPTION_SHARE) & (self._sent.sender != rows[:, None]))
        given = {name: _uniform(self._key, tick, name, (len(receiver),)) * 3.0 - 1.0 for name in MEASURES}
        at_ns = np.full(len(receiver), tick_start_ns(tick, RATE_HZ) - 1, np.int64)
        sender = self._sent.sender[payload]
        payloads: Payloads = self._sent.payloads
        return ReceivedPackets(rows[receiver], sender, np.full(len(receiver), tick), at_ns, given, payload, payloads)


class SyntheticInputs(NamedTuple):
    """The inputs of a group in a tick: time (tick, start and length in ns), readings, packets and tx statuses."""

    time: tuple[int, int, int]
    readings: GroupReadings
    received: ReceivedPackets
    tx_status: TxStatuses


def inputs(trial: Trial) -> Iterator[tuple[SyntheticInputs, Callable[[SentPackets], None]]]:
    """The inputs of the robots, tick by tick, each with a call that takes the packets that they send."""
    key, body = draws.derive_key("inputs", trial.seed), trial.spec
    medium = _Medium(key)
    for tick in range(trial.ticks):
        rows = np.flatnonzero(_uniform(key, tick, "drop-out", (trial.robots,)) >= DROP_OUT_SHARE)
        time_ns = tick_start_ns(tick, RATE_HZ)
        time = (tick, time_ns, tick_start_ns(tick + 1, RATE_HZ) - time_ns)
        readings = GroupReadings(rows, _readings(body, key, tick, rows))
        yield SyntheticInputs(time, readings, medium.received(tick, rows), medium.tx_status(tick)), medium.show


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
    fields.update(_around_and_below(body, key, tick, n))
    return fields


def _around_and_below(body: Body, key: int, tick: int, n: int) -> dict[str, FloatArray]:
    """Readings of infrared, scan, ground sensors and camera."""
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
