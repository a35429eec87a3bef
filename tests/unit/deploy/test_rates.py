"""Groups that act at different rates: the same run in every layout, and every clock of a robot shows its own period."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.runs import PER_ROBOT, run_spread

MIXED = """
format = 1
name = "two rates"
duration_s = 6.0
arena = {{ size_m = [4.0, 4.0] }}

[robots.scouts]
body = "epuck"
count = 5
agent = "swarmwire.agent.behaviours:Flocking"
act_every_ticks = {scouts}
params = {{ separation_m = 0.8 }}

[robots.carriers]
body = "footbot"
count = 4
agent = "{carriers}"
act_every_ticks = {every}

[radio]
range_m = 3.0
loss = 0.2
latency_s = 0.05
measures = {{ range = {{ noise_m = 0.02 }}, bearing = {{ noise_rad = 0.05 }} }}
"""
COUNTING = """
from swarmwire.agent import Agent, Message, f4

class Word(Message):
    number: f4

class Counting(Agent):
    needs = ("odometry",)

    def __init__(self):
        self.steps = self.words = 0

    def step(self, robot):
        assert round(robot.time_s / robot.period_s, 6) == self.steps
        times = [packet.received_at_ns for packet in robot.radio.received(Word)]
        assert times == sorted(times)
        assert all(robot.time_s - robot.period_s - 1e-9 < at / 1e9 <= robot.time_s for at in times)
        self.steps += 1
        self.words += len(times)
        robot.drive(0.01 * (self.words % 7), robot.odometry.left_m - robot.odometry.right_m + 0.2)
        robot.radio.send(Word(number=self.steps))
"""


SLOW = "robots.flock.act_every_ticks=4"


def radio_of(scenario, *overrides):
    radio = run(scenario, overrides=overrides).radio
    assert radio is not None
    return radio


@pytest.fixture
def mixed(tmp_path):
    (tmp_path / "counting.py").write_text(COUNTING)

    def written(scouts=1, every=3, carriers="counting.py:Counting"):
        path = tmp_path / f"mixed-{scouts}-{every}.toml"
        path.write_text(MIXED.format(scouts=scouts, every=every, carriers=carriers))
        return path

    return written


@pytest.mark.parametrize(("scouts", "every"), [(1, 3), (2, 5)])
def test_two_groups_of_different_rates_run_alike_in_every_layout(mixed, scouts, every):
    path = mixed(scouts, every)
    short = ["duration_s=3"]
    local = run(path, seeds=[1, 2], overrides=short)
    for runners in (1, 3, PER_ROBOT):
        other = run_spread(path, runners, seeds=[1, 2], overrides=short)
        assert other.trajectory_sha256 == local.trajectory_sha256
        assert [arena.radio for arena in other.arenas] == [arena.radio for arena in local.arenas]
    assert run(path, seed=2, overrides=short).trajectory_sha256[0] == local.trajectory_sha256[1]


def test_a_group_sends_as_often_as_it_acts(mixed):
    radio = radio_of(mixed(1, 3))
    assert radio.sent == 5 * 60 + 4 * 20
    assert sum(radio.fates.values()) == radio.intended == 8 * radio.sent


def test_packets_reach_a_slow_agent_at_the_tick_at_which_it_acts():
    every = ["duration_s=20", "radio.loss=0", "radio.jitter_s=0", "radio.send_offset='tick'", "radio.latency_s=0.05"]
    fast = radio_of(LOSSY, *every)
    slow = radio_of(LOSSY, *every, SLOW)
    assert fast.latency_agent_s.p50 == pytest.approx(0.1, rel=0.005)
    assert slow.latency_agent_s.p50 == pytest.approx(0.4, rel=0.005)
    assert slow.latency_air_s == fast.latency_air_s


@pytest.mark.parametrize("value", ["0", "1.5", "'2'"])
def test_a_rate_that_is_none_is_refused(value):
    with pytest.raises(BadInput, match="robots.flock.act_every_ticks"):
        run(LOSSY, overrides=[f"robots.flock.act_every_ticks={value}"])
