"""Events in a whole run: the same in every layout, told in the summary."""

import json

import pytest

from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import Result, run
from tests.support.deploy.runs import PER_ROBOT, ROOT, run_spread

DISRUPTED = ROOT / "scenarios" / "flocking-disrupted.toml"
# All that the scenario has happen in a minute, within four seconds.
TIMES = {"0": (0.3, 1.5), "1": (0.6, 0.9), "2": (1.1, None), "3": (1.3, 1.2), "4": (2.7, None)}
SHORT = [
    "duration_s=4",
    *(f"events.{i}.at_s={at_s}" for i, (at_s, _) in TIMES.items()),
    *(f"events.{i}.for_s={for_s}" for i, (_, for_s) in TIMES.items() if for_s),
]


@pytest.fixture(scope="module")
def local() -> Result:
    return run(DISRUPTED, overrides=SHORT)


@pytest.mark.parametrize("runners", [1, 3, PER_ROBOT])
def test_every_action_gives_the_same_run_in_every_layout(local, runners):
    """Per robot, runners are left with nobody alive, and get their robot back."""
    spread = run_spread(DISRUPTED, runners, overrides=SHORT)
    assert spread.trajectory_sha256 == local.trajectory_sha256
    assert (spread.radio, spread.metrics, spread.events) == (local.radio, local.metrics, local.events)


@pytest.mark.parametrize("runners", [None, 2])
def test_an_arena_with_events_is_the_same_alone_and_among_others(local, runners):
    three = run_spread(DISRUPTED, runners, overrides=SHORT, seeds=[5, 1, 9])
    assert three.trajectory_sha256[1] == local.trajectory_sha256[0]
    assert three.arenas[1].radio == local.radio
    assert [event.robots[1] for event in three.events] == [event.robots[0] for event in local.events]
    assert three.events[1].robots[0] != three.events[1].robots[1], "every arena draws its own robots"


def test_the_summary_tells_what_happened_when_and_to_whom(local, tmp_path):
    assert [(event.tick, event.do, event.ended) for event in local.events] == [
        (3, "blackout", False),
        (6, "kill", False),
        (11, "kill", False),
        (13, "partition", False),
        (15, "kill", True),
        (18, "blackout", True),
        (25, "partition", True),
        (27, "revive", False),
    ]
    run(DISRUPTED, overrides=SHORT, out=tmp_path / "run")
    told = json.loads((tmp_path / "run" / "summary.json").read_text())["events"]
    killed = local.events[1].robots[0]
    expected = {"at_s": 0.6, "tick": 6, "do": "kill", "part": "", "ended": False, "singly": False, "robots": killed}
    assert told[1] == expected
    assert len(killed) == 4
    assert [len(event["robots"]) for event in told if event["do"] == "partition"] == [10, 10]


def test_fates_add_up_and_each_disruption_has_its_own(local):
    fates = local.radio.fates
    assert sum(fates.values()) == local.radio.intended
    assert all(fates[name] > 0 for name in ("received", "receiver_dead", "blackout", "partitioned"))


def test_an_event_after_the_end_changes_nothing():
    late = [f"events.{i}.at_s=1000" for i in TIMES]
    result = run(DISRUPTED, overrides=["duration_s=2", *late])
    assert result.events == ()
    assert result.trajectory_sha256 == run(DISRUPTED, overrides=["duration_s=2", "events=[]"]).trajectory_sha256


REMEMBERS = """
from swarmwire.agent import Agent, Robot

class Remembers(Agent):
    def __init__(self):
        self.steps = 0

    def step(self, robot: Robot) -> None:
        self.steps += 1
        robot.drive(0.001 * self.steps, 0.0)
"""
AFRESH = """format = 1
name = "afresh"
duration_s = 1.0
arena = { size_m = [4.0, 4.0] }
robots.a = { body = "epuck", count = 2, agent = "mine.py:Remembers", place = { how = "grid", spacing_m = 1.0 } }
events = [{ at_s = 0.5, do = "kill", robots = { names = ["a-0"] }, for_s = 0.3 }]
"""


class Speeds(Observer):
    """Keeps the speeds asked for, in mm/s."""

    def begin(self, static):
        self.seen = []

    def see(self, truth):
        self.seen.append((truth.command[:, 0] * 1000).round().tolist())


@pytest.mark.parametrize("runners", [None, PER_ROBOT])
def test_a_robot_that_is_revived_starts_afresh(tmp_path, runners):
    """Its speed tells how many steps it remembers; it is dead in ticks 5 to 7."""
    (tmp_path / "mine.py").write_text(REMEMBERS)
    scenario = tmp_path / "s.toml"
    scenario.write_text(AFRESH)
    speeds = Speeds()
    run_spread(scenario, runners, observers=[speeds])
    assert speeds.seen == [[1, 1], [2, 2], [3, 3], [4, 4], [5, 5], [0, 6], [0, 7], [0, 8], [1, 9], [2, 10]]
