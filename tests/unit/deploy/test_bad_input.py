"""Bad input is refused at the door: one line with file, key and what was expected, exit code 2, no traceback."""

import socket

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from swarmwire.world.scenario.scenario_file import load_scenario
from tests.support.deploy.commands import LOSSY, called, swarmwire

AGENTS = """
import no_such_module_anywhere
"""
NEEDY = """
from swarmwire.agent import Agent, Robot

class Needy(Agent):
    needs = ("positioning",)
    def step(self, robot: Robot) -> None: ...

class Rssi(Agent):
    needs = ("radio.rssi",)
    def step(self, robot: Robot) -> None: ...

class Lazy(Agent):
    pass

class Strict(Agent):
    level: int
    def step(self, robot: Robot) -> None: ...

helper = 3
"""


LANE_AGENTS = """
from swarmwire.agent import Agent, PerRobot, Robot, Robots, State, VectorAgent

class Lanes(VectorAgent):
    lane: PerRobot[int]
    def step(self, robots: Robots, state: State) -> None: ...

class Lone(Agent):
    lane: PerRobot[int]
    def step(self, robot: Robot) -> None: ...
"""
LANES = "robots.flock={body='epuck', count=3, agent='lanes.py:Lanes'"


@pytest.fixture
def agents(tmp_path):
    (tmp_path / "lanes.py").write_text(LANE_AGENTS)
    (tmp_path / "broken.py").write_text(AGENTS)
    (tmp_path / "needy.py").write_text(NEEDY)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(LOSSY.read_text())
    return scenario


def refused(scenario, *settings, **options) -> str:
    with pytest.raises(BadInput) as error:
        run(scenario, overrides=list(settings), **options)
    text = str(error.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("setting", "key", "expected"),
    [
        ("robots.flock.cuont=3", "robots.flock.cuont", "unknown key"),
        ("rdio={}", "rdio", "unknown key"),
        ("robots.flock.count='x'", "robots.flock.count", "whole number"),
        ("robots.flock.count=0", "robots.flock.count", "at least 1"),
        ("radio.loss=1.5", "radio.loss", "at most 1"),
        ("radio.range_m=-1", "radio.range_m", "above 0"),
        ("radio.model='fog'", "radio.model", "disk"),
        ("radio.send_offset='sometimes'", "radio.send_offset", "uniform"),
        ("radio.send_offset=-0.1", "radio.send_offset", "from 0 to"),
        ("duration_s=0", "duration_s", "above 0"),
        ("format=2", "format", "1"),
        ("physics.steps=1", "physics.steps", "2"),
        ("robots.flock.body='blimp'", "robots.flock.body", "epuck"),
        ("robots.flock.place.radius_m=0.1", "robots.flock", "room"),
        ("robots.flock.params.separation=1", "robots.flock.params.separation", "separation_m"),
        ("robots.flock.params.separation_m='far'", "robots.flock.params.separation_m", "a number"),
        ("robots.flock.agent='nowhere.at.all:X'", "robots.flock.agent", "does not import"),
        ("robots.flock.agent='swarmwire.agent.behaviours:Dance'", "robots.flock.agent", "Dance"),
        ("robots.flock.agent='flocking'", "robots.flock.agent", "module:Class"),
        ("robots.flock.agent='math:pi'", "robots.flock.agent", "no Agent"),
        ("robots.flock.agent='absent.py:X'", "robots.flock.agent", "there is no file"),
        ("robots.flock.agent='broken.py:X'", "robots.flock.agent", "no_such_module_anywhere"),
        ("robots.flock.agent='needy.py:helper'", "robots.flock.agent", "no Agent"),
        ("robots.flock.agent='needy.py:Lazy'", "robots.flock.agent", "no step method"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Strict'}", "robots.flock.params.level", "is missing"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Needy'}", "robots.flock.agent", "lacks"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Rssi'}", "robots.flock.agent", "radio does not tell"),
        ("radio.gives={}", "robots.flock.agent", "radio.range"),
    ],
)
def test_a_bad_value_is_named_with_its_key_and_what_was_expected(agents, setting, key, expected):
    text = refused(agents, setting)
    assert key in text
    assert expected in text
    assert "scenario.toml" in text or "--set" in text


WIDER = [
    ("events=3", "events: expected a list, got 3"),
    (
        "events=[{at_s=1}]",
        "events.0.do: is missing; expected one of blackout, fail, gain, jammer, kill, partition, push, ramp, revive",
    ),
    (
        "events=[{at_s=1, do='burn'}]",
        "events.0.do: expected one of blackout, fail, gain, jammer, kill, partition, push, ramp, revive; got 'burn'",
    ),
    (
        "events=[{at_s=nan, do='kill', robots={count=1}}]",
        "events.0.at_s: expected a number of at least 0 and at most 1000000000 (s), got nan",
    ),
    (
        "events=[{at_s=1, do='kill', robots={count=1}, for_s=0}]",
        "events.0.for_s: expected a number above 0 and at most 1000000000 (s), got 0",
    ),
    ("events=[{at_s=1, do='kill', robots=3}]", "events.0.robots: expected a table, got 3"),
    (
        "events=[{at_s=1, do='kill', robots={grup='flock'}}]",
        "events.0.robots.grup: unknown key; expected one of group, names, share, count",
    ),
    (
        "events=[{at_s=1, do='kill', robots={group='flok'}}]",
        "events.0.robots.group: expected one of flock (did you mean flock?); got 'flok'",
    ),
    (
        "events=[{at_s=1, do='revive', robots={names=['flock-20']}}]",
        "events.0.robots.names: expected names of robots, such as flock-0; got 'flock-20'",
    ),
    (
        "events=[{at_s=1, do='kill', robots={share=5}}]",
        "events.0.robots.share: expected a number above 0 and at most 1, got 5",
    ),
    (
        "events=[{at_s=1, do='partition', between=['flock-0', 'flock-1']}]",
        "events.0.between.0: expected a list, got 'flock-0' (also wrong: events.0.between.1)",
    ),
    (
        "events=[{at_s=1, do='partition', between=[['flock'], ['flock-1']]}]",
        "events.0.between.1: expected sets that do not overlap; 'flock-1' is in two",
    ),
    (
        "arena.lights=[{intensity=1, at=[0, 0], place='random'}]",
        'arena.lights.0: expected either at = [x, y] or place = "random"',
    ),
    (
        "arena.lights=[{intensity=-1, at=[0, 0]}]",
        "arena.lights.0.intensity: expected a number above 0 and at most 10000 (m), got -1",
    ),
    (
        "arena.lights=[{intensity=1, at=[0, 0], colour='red'}]",
        "arena.lights.0.colour: unknown key; expected one of at, place, count, within, apart_m, intensity",
    ),
    (
        "arena.lights=[{intensity=1, at=[9, 0]}]",
        "arena.lights.0: no room for light 1 of 1 with seed 1: at (9, 0) it is outside or in an obstacle",
    ),
    (
        "arena.obstacles=[{shape='polygon', at=[0, 0]}]",
        "arena.obstacles.0.points: is missing; expected a list (m)",
    ),
    (
        "arena.obstacles=[{shape='polygon', at=[0, 0], points=[[0, 0], [1, 0], ['x', 1]]}]",
        "arena.obstacles.0.points.2.0: expected a number of at least -10000 and at most 10000 (m), got 'x'",
    ),
    (
        "arena.obstacles=[{shape='polygon', at=[0, 0], points=[[0, 0], [1, 1], [1, 0], [0, 1]]}]",
        "arena.obstacles.0.points: expected the corners of a convex polygon in order; "
        "(0, 0) lies on or beyond the side from (0, 1) to (1, 0)",
    ),
    (
        "arena.obstacles=[{shape='polygon', at=[4, 0], points=[[0, 0], [1, 0], [0, 1]]}]",
        "arena.obstacles.0: expected the polygon to lie within the arena of 8 x 8 m",
    ),
    (
        "arena.obstacles=[{shape='polygon', place='random', count=99, points=[[0, 0], [3, 0], [0, 3]]}]",
        "arena.obstacles.0: no room for polygon ",
    ),
    (
        "robots.flock.act_every_ticks=0",
        "robots.flock.act_every_ticks: expected a whole number of at least 1 and at most 1000000 (ticks), got 0",
    ),
    (
        "robots.flock.act_every_ticks=1.5",
        "robots.flock.act_every_ticks: expected a whole number of at least 1 and at most 1000000 (ticks), got 1.5",
    ),
    (
        f"{LANES}}}",
        "robots.flock.params.lane: is missing: expected a whole number",
    ),
    (
        f"{LANES}, params={{lane=[1, 2]}}}}",
        "robots.flock.params.lane: expected a whole number, or a list with one for each of the 3 robots, "
        "got a list of 2",
    ),
    (
        f"{LANES}, params={{lane=[1, 2, 0.5]}}}}",
        "robots.flock.params.lane: expected a whole number, or a list with one for each of the 3 robots, got 0.5",
    ),
    (
        "robots.flock={body='epuck', count=3, agent='lanes.py:Lone'}",
        "robots.flock.agent: Lone.lane: only a VectorAgent has parameters per robot",
    ),
]


@pytest.mark.parametrize(("setting", "text"), WIDER)
def test_events_lights_polygons_rates_and_numbers_per_robot_are_checked_at_the_door(agents, setting, text):
    """One line: the file or the override that is at fault, then key and what was expected."""
    place, _, rest = refused(agents, setting).partition(": ")
    assert place in (str(agents), f"--set {setting}")
    assert rest.startswith(text)


@pytest.mark.parametrize("place", [5, 15, 21, 24])
def test_the_check_command_refuses_them_in_the_same_words(agents, place):
    setting, text = WIDER[place]
    ended = swarmwire("check", agents, "--set", setting)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert text in ended.stderr
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1


def test_an_event_of_the_radio_needs_a_radio(agents):
    text = agents.read_text()
    agents.write_text(text[: text.index("[radio]")])
    events = "events=[{at_s=1, do='blackout', robots={count=1}}]"
    told = refused(agents, events)
    assert told == f"--set {events}: events.0.do: expected a scenario with a [radio] for 'blackout'"
    told = refused(agents)
    assert told.endswith("needs 'radio.range', which only a radio tells: there is no [radio]")


def test_check_tells_of_events_that_come_too_late(monkeypatch, capsys):
    setting = "events=[{at_s=1.9, do='kill', robots={count=1}}, {at_s=1.95, do='kill', robots={count=1}}]"
    code, out, _ = called(monkeypatch, capsys, "check", LOSSY, "--set", setting, "--set", "duration_s=2")
    assert code == 0
    assert out.endswith("engine discs; too late to happen: events.1\n")


def test_files_that_are_no_scenario_are_named(tmp_path):
    assert "absent.toml" in refused(tmp_path / "absent.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("robots = [")
    assert "bad.toml" in refused(bad)


@pytest.mark.parametrize("runners", [0, 21, "many", True])
def test_a_number_of_runners_that_cannot_be_is_refused(runners):
    assert "per-robot" in refused(LOSSY, runners=runners)


def test_seeds_must_be_different_and_not_negative():
    for seeds in ([], [1, 1], [-1]):
        assert "seeds" in refused(LOSSY, seeds=seeds)
    assert "seed" in refused(LOSSY, seed=1, seeds=[2])


def test_overrides_are_of_a_file():
    assert "a Scenario is complete as it is" in refused(load_scenario(LOSSY), "seed=2")


def test_a_folder_that_holds_something_is_refused(tmp_path):
    (tmp_path / "kept").touch()
    assert "new or empty" in refused(LOSSY, out=tmp_path)
    assert "can be made" in refused(LOSSY, out=tmp_path / "kept" / "run")


def test_a_socket_in_use_or_of_no_use_is_refused(tmp_path):
    assert "a directory that exists" in refused(LOSSY, runners=1, socket=tmp_path / "absent" / "s")
    assert "at most 107" in refused(LOSSY, runners=1, socket=tmp_path / ("s" * 110))
    taken = tmp_path / "s"
    taken.mkdir()
    assert "free" in refused(LOSSY, runners=1, socket=taken)


def test_a_refused_socket_leaves_no_run_folder(tmp_path):
    for path in (tmp_path / "absent" / "s", tmp_path / ("s" * 110), tmp_path):
        assert "--socket" in refused(LOSSY, runners=1, socket=path, out=tmp_path / "run")
        assert not (tmp_path / "run").exists()


def test_a_stale_socket_is_taken_over(tmp_path):
    stale = tmp_path / "s"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(stale))
    result = run(LOSSY, overrides=["duration_s=0.5"], runners=1, socket=stale)
    assert result.ticks == 5


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", LOSSY, "--set", "robots.flock.count=many"],
        ["run", LOSSY, "--seeds", "9:1"],
        ["run", LOSSY, "--runners", "all"],
        ["run", "absent.toml"],
        ["check", LOSSY, "--set", "nonsense"],
    ],
)
def test_the_command_says_one_line_and_exits_with_2(arguments, tmp_path):
    ended = swarmwire(*arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_a_path_that_holds_something_is_not_touched(tmp_path):
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    assert "something else is there" in refused(LOSSY, runners=1, socket=notes)
    assert notes.read_text() == "mine"
    with socket.socket(socket.AF_UNIX) as busy:
        busy.bind(str(tmp_path / "busy"))
        busy.listen()
        assert "in use" in refused(LOSSY, runners=1, socket=tmp_path / "busy")
        assert (tmp_path / "busy").is_socket()


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("robots.flock.params.separation_m=nan", "finite"),
        ("robots.flock.params.separation_m=99999999999999999999", "64 bits"),
        ("radio.bit_rate_bps=1000000000000000000000", "at most 1000000000000"),
        ("radio.queue_limit=1000000000000000000000", "at most 1000000"),
    ],
)
def test_numbers_that_nothing_could_work_with_are_refused(setting, expected):
    assert expected in refused(LOSSY, setting)


def test_needs_that_are_no_names_are_refused(tmp_path):
    for needs in ("None", "(3,)", '"proximity"'):
        agent = tmp_path / f"odd{len(needs)}.py"
        agent.write_text(f"{NEEDY}\nclass Odd(Needy):\n    needs = {needs}\n")
        assert "a tuple of texts" in refused(LOSSY, f"robots.flock.agent={agent}:Odd", "robots.flock.params={}")
