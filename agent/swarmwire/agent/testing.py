"""Checks for agents, ours and users': two agents that are the same rule, and rows that do not see one another.

Both feed made-up senses and packets, keyed by a seed, through the same host that runs agents anywhere: ragged packets
(what robots sent a tick ago, heard by some), outcomes of addressed ones if the agent asks, robots that drop out and
come back, any body and parameters.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swarmwire.agent.agent import Agent
from swarmwire.agent.host import Hosted, hosted
from swarmwire.agent.loading import AgentClass
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms import draws
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.assignment import GroupAssignment, params_of
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.bodies.leds import BRIGHTEST
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes, SendResult
from swarmwire.comms.packets import UNTOLD, Heard, Payloads, Sent
from swarmwire.comms.senses import Actions, GroupSenses
from swarmwire.comms.sheets import Camera, GroundColour, OwnSheet

RATE_HZ = 10
GIVEN = ("range_m", "bearing_rad", "rssi_dbm")
DROP_OUT = 0.1  # share of the robots missing in a tick
HEARING = 0.4  # share of the senders that a robot hears
LEARNING = 0.6  # share of the outcomes still to come that come in a tick


@dataclass(frozen=True)
class Trial:
    """What to try an agent with."""

    robots: int = 7
    ticks: int = 12
    seed: int = 1
    body: str | Body = "epuck"  # one that comes with swarmwire, or any other
    params: dict[str, Any] | None = None  # a list has a value for each robot


def assert_equivalent(single: type[Agent], vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless both do exactly the same, bit for bit, for robots that sense and hear the same."""
    trial = trial or Trial()
    one, other = (_host(kind, trial, np.arange(trial.robots)) for kind in (single, vector))
    for given, show in _inputs(trial):
        first, second = one.act(*given), other.act(*given)
        names = f"{single.__name__} and {vector.__name__}"
        _assert_same(first, second, f"{names} differ in tick {given.time[0]}")
        show(first.sent)


def assert_rows_independent(vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless n rows at once do exactly what each row does alone, bit for bit: so no row peeks."""
    trial = trial or Trial()
    together = _host(vector, trial, np.arange(trial.robots))
    alone = [_host(vector, trial, np.array([row])) for row in range(trial.robots)]
    for given, show in _inputs(trial):
        at_once = together.act(*given)
        each = [host.act(*_only(row, given)) for row, host in enumerate(alone)]
        text = f"rows of {vector.__name__} are not independent in tick {given.time[0]}"
        _assert_same(at_once, Actions.joined(each), text)
        show(at_once.sent)


def _body(trial: Trial) -> Body:
    return load_body(trial.body) if isinstance(trial.body, str) else trial.body


def _host(kind: AgentClass, trial: Trial, rows: IntArray) -> Hosted:
    keys = np.array([draws.derive_key("trial", trial.seed, int(row)) for row in rows], np.uint64)
    names = tuple(f"robot-{row}" for row in rows)
    params = params_of(trial.params or {}, rows)
    group = GroupAssignment("trial", "", params, _body(trial), rows, names, keys)
    return hosted(group, kind)


class _Ether:
    """What was sent a tick ago, heard at random, and what became of it, told at random."""

    def __init__(self, key: int) -> None:
        self._key, self._sent = key, Sent.none()
        self._untold = NO_OUTCOMES

    def show(self, sent: Sent) -> None:
        self._sent = sent.select(np.argsort(sent.sender, kind="stable"))
        asked = np.flatnonzero(self._sent.outcome_ids != UNTOLD)
        row, id_ = self._sent.sender[asked], self._sent.outcome_ids[asked]
        chance = draws.uniform(self._key, row, id_, 0, draws.purpose("outcome"))
        new = Outcomes(row, id_, (chance * len(SendResult)).astype(np.int64))
        self._untold = Outcomes.joined([self._untold, new])

    def outcomes(self, tick: int) -> Outcomes:
        """As the air would tell them: also to robots that have dropped out, and to those that have forgotten."""
        comes = _uniform(self._key, tick, "learning", (len(self._untold),)) < LEARNING
        told, self._untold = (self._untold.select(np.flatnonzero(now)) for now in (comes, ~comes))
        return told

    def heard(self, tick: int, rows: IntArray) -> Heard:
        chance = _uniform(self._key, tick, "hearing", (len(rows), len(self._sent)))
        receiver, payload = np.nonzero((chance < HEARING) & (self._sent.sender != rows[:, None]))
        given = {name: _uniform(self._key, tick, name, (len(receiver),)) * 3.0 - 1.0 for name in GIVEN}
        at_ns = np.full(len(receiver), tick_start_ns(tick, RATE_HZ) - 1, np.int64)
        sender = self._sent.sender[payload]
        payloads: Payloads = self._sent.payloads
        return Heard(rows[receiver], sender, np.full(len(receiver), tick), at_ns, given, payload, payloads)


class _Given(NamedTuple):
    """What a group is given in a tick."""

    time: tuple[int, int, int]
    senses: GroupSenses
    heard: Heard
    outcomes: Outcomes


def _inputs(trial: Trial) -> Iterator[tuple[_Given, Callable[[Sent], None]]]:
    """What the robots are given, tick by tick, and whom to show what they sent."""
    key = draws.derive_key("inputs", trial.seed)
    body, ether = _body(trial), _Ether(key)
    for tick in range(trial.ticks):
        rows = np.flatnonzero(_uniform(key, tick, "drop-out", (trial.robots,)) >= DROP_OUT)
        time_ns = tick_start_ns(tick, RATE_HZ)
        time = (tick, time_ns, tick_start_ns(tick + 1, RATE_HZ) - time_ns)
        senses = GroupSenses(rows, _senses(body, key, tick, rows))
        yield _Given(time, senses, ether.heard(tick, rows), ether.outcomes(tick)), ether.show


def _senses(body: Body, key: int, tick: int, rows: IntArray) -> dict[str, FloatArray]:
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
    if "bumper" in body.senses:
        fields["bumper.pressed"] = np.round(_uniform(key, tick, "bumper", (n,)))
    if "positioning" in body.senses:
        for axis in ("x_m", "y_m"):
            fields[f"positioning.{axis}"] = _uniform(key, tick, axis, (n,)) * 4.0 - 2.0
    if "imu" in body.senses:
        for name in ("forward_mps2", "left_mps2", "turn_radps"):
            fields[f"imu.{name}"] = _uniform(key, tick, name, (n,)) * 2.0 - 1.0
    if "battery" in body.senses:
        charge = _uniform(key, tick, "battery", (n,))
        fields["battery.charge"], fields["battery.voltage_v"] = charge, 3.4 + 0.8 * charge
    for name, sheet in body.senses.items():
        if isinstance(sheet, OwnSheet):
            for field, width in sheet.fields.items():
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
    ground, camera = body.senses.get("ground"), body.senses.get("camera")
    if isinstance(ground, GroundColour):
        fields["ground.shade"] = _uniform(key, tick, "ground", (n, len(ground.points_m)))
    if isinstance(camera, Camera):
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


def _only(row: int, given: _Given) -> _Given:
    at = np.flatnonzero(given.senses.rows == row)
    own = GroupSenses(given.senses.rows[at], {name: column[at] for name, column in given.senses.fields.items()})
    heard = given.heard.select(np.flatnonzero(given.heard.receiver == row))
    return _Given(given.time, own, heard, given.outcomes.select(np.flatnonzero(given.outcomes.row == row)))


def _assert_same(first: Actions, second: Actions, text: str) -> None:
    for name in ("rows", "drive", "linear_mps", "angular_radps", "lateral_mps"):
        one, other = getattr(first, name), getattr(second, name)
        if not np.array_equal(one, other, equal_nan=name not in ("rows", "drive")):
            raise AssertionError(f"{text}: {name}\n{one}\n{other}")
    if _states(first) != _states(second):
        raise AssertionError(f"{text}: states\n{_states(first)}\n{_states(second)}")
    if _leds(first) != _leds(second):
        raise AssertionError(f"{text}: leds\n{_leds(first)}\n{_leds(second)}")
    if _actuations(first) != _actuations(second):
        raise AssertionError(f"{text}: actuators\n{_actuations(first)}\n{_actuations(second)}")
    if _packets(first.sent) != _packets(second.sent):
        raise AssertionError(f"{text}: packets\n{_packets(first.sent)}\n{_packets(second.sent)}")


def _states(actions: Actions) -> dict[int, str]:
    notes = actions.notes
    return {int(row): notes.names[code] for row, code in zip(notes.rows, notes.code, strict=True)}


def _leds(actions: Actions) -> dict[tuple[int, int], int]:
    """The colours that LEDs were switched to, by robot and LED."""
    rows, which, rgb = actions.leds.rows.tolist(), actions.leds.which.tolist(), actions.leds.rgb.tolist()
    return dict(zip(zip(rows, which, strict=True), rgb, strict=True))


def _actuations(actions: Actions) -> dict[tuple[int, int], float]:
    """What own actuators were set to, by robot and place."""
    rows, place, value = actions.own.rows.tolist(), actions.own.place.tolist(), actions.own.value.tolist()
    return dict(zip(zip(rows, place, strict=True), value, strict=True))


def _packets(sent: Sent) -> list[tuple[int, int, int, bytes]]:
    of = sent.select(np.argsort(sent.sender, kind="stable"))
    numbers = zip(of.sender.tolist(), of.to.tolist(), of.outcome_ids.tolist(), strict=True)
    return [(*three, of.payloads.row(i)) for i, three in enumerate(numbers)]
