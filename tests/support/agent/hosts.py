"""Input of hosts, backends and lockstep in tests: assignments, readings and received packets."""

from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.agent.agent import AgentClass
from swarmwire.agent.agent_group import AgentGroup, agent_group
from swarmwire.comms.base import draws
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment
from tests.support.agent.players import Word

PLAYERS = Path(__file__).with_name("players.py")
MEASURES = ("range_m", "bearing_rad")
PERIOD_NS = 100_000_000
TIMES = {"timeout_s": 10.0, "answer_within_s": None}  # keys of a world's reply to a request
SILENCE = ReceivedPackets.none(MEASURES)


def spec(name: str) -> str:
    """The spec of an agent in `players`, as a file."""
    return f"{PLAYERS}:{name}"


def group(
    agent: str, rows: list[int], name: str = "flock", body: str = "epuck", params: dict[str, Any] | None = None
) -> GroupAssignment:
    keys = np.array([draws.derive_key("robot", 5, row) for row in rows], np.uint64)
    names = tuple(f"{name}-{row}" for row in rows)
    return GroupAssignment(name, agent, params or {}, load_body(body), np.array(rows, np.int64), names, keys)


def assignment(*groups: GroupAssignment) -> Assignment:
    return Assignment(groups, 10, MEASURES)


def readings(tick: int, rows: list[int], rays: int = 8) -> GroupReadings:
    """Readings that differ by robot and tick, and depend on no other robot."""
    row = np.array(rows, np.int64)
    fields = {
        "proximity.value": np.stack([np.sin(tick + row + ray) ** 2 for ray in range(rays)], 1).reshape(len(rows), rays),
        "compass.heading_rad": np.sin(1.0 + tick + row),
        "odometry.left_m": 0.1 * tick + row,
        "odometry.right_m": 0.2 * tick - row,
    }
    return GroupReadings(row, fields)


def received_from(sent: SentPackets, receivers: list[int]) -> ReceivedPackets:
    """The packets as received by all of these robots but the sender, in the order of the medium."""
    sent = by_sender(sent)
    pairs = [(to, p) for to in receivers for p in range(len(sent)) if sent.sender[p] != to]
    receiver, payload = (np.array([pair[i] for pair in pairs], np.int64) for i in (0, 1))
    sender = sent.sender[payload]
    measured = {"range_m": 0.1 + 0.3 * np.abs(receiver - sender), "bearing_rad": np.sin(1.0 * receiver - sender)}
    return ReceivedPackets(receiver, sender, payload, 10 + payload, measured, payload, sent.payloads)


def by_sender(sent: SentPackets) -> SentPackets:
    order = np.argsort(sent.sender, kind="stable")
    return SentPackets(sent.sender[order], sent.to[order], sent.payloads.select(order))


def plain(actions: Actions) -> list[Any]:
    """Actions as plain values, by robot, to be compared bit for bit."""
    order = np.argsort(actions.rows, kind="stable")
    columns = (actions.rows, actions.drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps)
    sent = by_sender(actions.sent)
    payloads = [sent.payloads.row(i) for i in range(len(sent))]
    switched = np.array((actions.leds.rows, actions.leds.slot, actions.leds.value))
    leds = sorted(switched.T.tolist())
    return [*(column[order].tolist() for column in columns), sent.sender.tolist(), sent.to.tolist(), payloads, leds]


def one_group(tick: int, rows: list[int]) -> Readings:
    return {"flock": readings(tick, rows)}


def agents_for(kind: AgentClass, rows: list[int]) -> AgentGroup:
    """The agents of this class for these rows."""
    return agent_group(group("", rows), kind)


def step(
    agents: AgentGroup,
    tick: int,
    rows: list[int],
    received: ReceivedPackets = SILENCE,
    tx_statuses: TxStatuses = NO_TX_STATUSES,
) -> Actions:
    """One step of the robots in these rows."""
    return agents.act((tick, tick * PERIOD_NS, PERIOD_NS), readings(tick, rows), received, tx_statuses)


def words(*senders: int) -> SentPackets:
    """A broadcast from each sender with its number."""
    payloads = [Word(number=float(sender)).encode() for sender in senders]
    return SentPackets(np.array(senders), np.full(len(senders), BROADCAST), Payloads.from_rows(payloads))
