"""Observations and actions of policies, by way of the handles of robots."""

from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.policy_io import PolicyIO, PolicyLayout, policy_message
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.drives import wheels_of_twist
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets
from swarmwire.comms.robot.tick_io import Actions, GroupReadings
from tests.support.agent.hosts import group
from tests.support.agent.one_step import vector_agent_doing
from tests.support.refusals import refused_input
from tests.unit.learn.scripted_agent import Scripted

TIME = (0, 0, 10**8)
RAYS, HEADING = np.linspace(0.0, 1.0, 16).reshape(2, 8), np.array([0.5, np.pi])


def _received(*packets: tuple[int, int, float, float, list[float]]) -> ReceivedPackets:
    """Packets in order of reception: robot, sender, range in m, bearing in rad, and the numbers sent."""
    receiver, sender, range_m, bearing, numbers = zip(*packets, strict=True)
    kind = policy_message(len(numbers[0]))
    payloads = Payloads.from_rows([kind(**{f"v{k}": v for k, v in enumerate(row)}).encode() for row in numbers])
    measured = {"range_m": np.array(range_m), "bearing_rad": np.array(bearing)}
    k = np.arange(len(packets))
    return ReceivedPackets(np.array(receiver), np.array(sender), k, k, measured, k, payloads)


def _observed(io: PolicyIO, received: ReceivedPackets, **readings: Any) -> list[dict[str, float]]:
    """What two e-pucks see, by name."""
    layout, observations = PolicyLayout(io, load_body("epuck")), []
    looks = vector_agent_doing(lambda robots: observations.append(layout.observe(robots)), *io.needs)
    fields = {"proximity.value": RAYS, "compass.heading_rad": HEADING, **readings}
    agent_group(group("", [0, 1]), looks).act(TIME, GroupReadings(np.arange(2), fields), received)
    assert observations[0].dtype == np.float32
    assert ((layout.low <= observations[0]) & (observations[0] <= layout.high)).all()
    return [dict(zip(layout.observation, row.tolist(), strict=True)) for row in observations[0]]


def _slots(row: dict[str, float]) -> list[list[float]]:
    """The numbers of each neighbour's slot."""
    slots: dict[str, list[float]] = defaultdict(list)
    for name, value in row.items():
        if name.startswith("neighbour"):
            slots[name.split()[1]].append(value)
    return list(slots.values())


def test_readings_are_scaled_by_their_fields():
    first, second = _observed(PolicyIO(sensors=("proximity", "compass")), ReceivedPackets.none())
    assert [first[f"proximity.value[{k}]"] for k in range(8)] == pytest.approx(RAYS[0].tolist())
    assert (first["sin compass.heading_rad"], first["cos compass.heading_rad"]) == pytest.approx(
        (np.sin(0.5), np.cos(0.5))
    )
    lost = {"compass.heading_rad": np.array([np.nan, 0.0]), "proximity.value": np.full((2, 8), np.nan)}
    first, second = _observed(PolicyIO(sensors=("proximity", "compass")), ReceivedPackets.none(), **lost)
    assert set(first.values()) == {0.0}
    assert second["cos compass.heading_rad"] == 1.0


def test_slots_have_the_newest_packet_of_each_of_the_nearest_senders():
    io = PolicyIO(measures=("radio.range", "radio.bearing"), neighbours=2, order="nearest", message=1)
    far, near, old, new = (
        (1, 5, 2.0, 0.0, [0.5]),
        (1, 6, 1.0, np.pi / 2, [0.25]),
        (1, 7, 0.5, 0, [1]),
        (1, 7, 3, 0, [-1]),
    )
    none, filled = _observed(io, _received(old, far, near, new))
    assert _slots(none) == [[0.0] * 5] * 2
    assert _slots(filled) == [pytest.approx([1, 1, 1, 0, 0.25], abs=1e-7), pytest.approx([1, 2, 0, 1, 0.5])]


def test_slots_by_time_have_the_newest_first():
    io = PolicyIO(neighbours=3, order="newest", message=1)
    packets = _received((0, 4, 1, 0, [0.1]), (0, 5, 1, 0, [0.2]), (0, 4, 1, 0, [0.3]), (1, 5, 1, 0, [0.4]))
    first, second = _observed(io, packets)
    assert _slots(first) == [pytest.approx([1, 0.3]), pytest.approx([1, 0.2]), [0, 0]]
    assert _slots(second) == [pytest.approx([1, 0.4]), [0, 0], [0, 0]]


def test_shared_heading_arrives_relative_to_the_receivers():
    io = PolicyIO(sensors=("compass",), neighbours=1, shared=("compass",))
    first, second = _observed(
        io, _received((0, 1, 1, 0, [np.sin(2.0), np.cos(2.0)]), (1, 0, 1, 0, [np.sin(2.0), np.cos(2.0)]))
    )
    assert _slots(first) == [pytest.approx([1, np.sin(1.5), np.cos(1.5)], abs=1e-6)]
    assert _slots(second) == [pytest.approx([1, np.sin(2.0 - np.pi), np.cos(2.0 - np.pi)], abs=1e-6)]


def _done(io: PolicyIO, body: str, action: list[list[float]]) -> Actions:
    """What two robots do."""
    layout = PolicyLayout(io, load_body(body))
    does = vector_agent_doing(lambda robots: layout.act(robots, np.array(action, np.float32)), *io.needs)
    readings = GroupReadings(np.arange(2), {"compass.heading_rad": HEADING})
    return agent_group(group("", [0, 1], body=body), does).act(TIME, readings, ReceivedPackets.none())


def test_action_drives_within_the_limits_and_sends():
    body = load_body("epuck")
    io = PolicyIO(sensors=("compass",), message=1, shared=("compass",))
    actions = _done(io, "epuck", [[0.5, 0.25, -0.5], [7.0, -1.0, 0.125]])
    assert actions.linear_mps[0] == pytest.approx(0.5 * body.max_linear_mps)
    assert actions.angular_radps[0] == pytest.approx(0.25 * body.max_angular_radps)
    left, right = wheels_of_twist(actions.linear_mps, actions.angular_radps, body.wheels.wheel_base_m)
    assert np.maximum(abs(left), abs(right))[1] == pytest.approx(body.max_linear_mps)
    assert actions.angular_radps[1] / actions.linear_mps[1] == pytest.approx(
        -body.max_angular_radps / body.max_linear_mps
    )
    sent = [policy_message(3).decode(actions.sent.payloads.row(k)) for k in range(2)]
    assert [message.v0 for message in sent] == [-0.5, 0.125]
    assert [message.v1 for message in sent] == pytest.approx(np.sin(HEADING).tolist(), abs=1e-6)
    assert actions.sent.sender.tolist() == [0, 1]


def test_action_of_a_holonomic_body_moves_sideways():
    actions = _done(PolicyIO(speed_mps=0.2, turn_radps=0.1), "crazyflie", [[0.0, -1.0, 0.5], [1.0, 1.0, 1.0]])
    assert (actions.lateral_mps[0], actions.angular_radps[0]) == pytest.approx((-0.2, 0.05))
    assert np.hypot(actions.linear_mps, actions.lateral_mps)[1] <= load_body("crazyflie").max_linear_mps * (1 + 1e-12)
    assert len(actions.sent) == 0


def test_policy_rows_are_independent():
    assert_rows_independent(Scripted, Trial(robots=9))


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ({"neighbours": 65}, "neighbours"),
        ({"message": -1}, "message"),
        ({"speed_mps": 0.0}, "speed_mps"),
        ({"measures": ("radio.tx_status",)}, "measures"),
        ({"shared": ("compass",)}, "shared"),
        ({"order": "nearest", "neighbours": 1}, "order"),
    ],
)
def test_contradictory_fields_are_refused(fields: dict[str, Any], key: str):
    with refused_input(key=key):
        PolicyIO(**fields)
