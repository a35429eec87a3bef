"""A simulation stepped by hand, in real time, or with what is asked of an execution: seeds, runners and pace."""

import errno
import json
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.errors import AgentFailed, BadInput, RecordFailed
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy import Simulation, repeat, run
from swarmwire.deploy.runs import simulation as simulation_module
from swarmwire.deploy.runs.config import MAX_ARENAS, choose_seeds, parse_factor, runner_count, seed_list
from swarmwire.deploy.runs.record import folder as record_folder
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.scenario_file import scenario_from
from tests.support.clocks import MS, FakeClock, GoingClock
from tests.support.deploy.runs import LOSSY, called, run_spread
from tests.support.refusals import refused_input
from tests.support.world.scenes import changed

SHORT = ["duration_s=2"]


STILL = """from swarmwire.agent import Agent

class Still(Agent):
    def step(self, robot):
        robot.drive(linear_mps=0.1, angular_radps=0.0)
"""
NAMES_FILES = """format = 1
name = "swarm"
duration_s = 1
[arena]
map = { image = "walls.pgm", resolution_m = 1.0 }
[robots.flock]
body = "mine.toml"
agent = "still.py:Still"
count = 2
place = { how = "disc", radius_m = 1.0 }
"""


def test_steps_by_hand_make_the_same_run_and_metrics_can_be_read_between():
    with Simulation(LOSSY, overrides=SHORT) as simulation:
        ticks = [simulation.step().tick for _ in range(7)]
        simulation.run(20)
        order = simulation.metrics.latest["order"][0]
        assert (ticks, simulation.tick) == (list(range(7)), 20)
    complete = run(LOSSY, overrides=SHORT)
    assert simulation.result.ended == "duration"
    assert simulation.result.trajectory_sha256 == complete.trajectory_sha256
    assert simulation.result.metrics["order"].final == complete.metrics["order"].final == order


def test_run_that_is_left_early_has_a_summary_so_far(tmp_path):
    with Simulation(LOSSY, overrides=SHORT, out=tmp_path / "run") as simulation:
        simulation.run(5)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"], summary["error"]) == ("left", 5, None)
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]


@pytest.mark.parametrize("runners", [None, 2])
def test_failed_run_has_its_error_in_the_summary(tmp_path: Path, runners):
    agent = tmp_path / "bad.py"
    agent.write_text(
        "from swarmwire.agent import Agent\n\nclass Bad(Agent):\n    def step(self, robot):\n"
        "        if robot.time_s > 0.4:\n            raise RuntimeError('no more')\n"
    )
    overrides = [*SHORT, f"robots.flock.agent='{agent}:Bad'", "robots.flock.params={}"]
    with pytest.raises(AgentFailed):
        run_spread(LOSSY, runners, overrides=overrides, out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"]) == ("failed", 5)
    assert "no more" in summary["error"]


def test_caller_error_ends_the_run_and_propagates(tmp_path):
    simulation = Simulation(LOSSY, overrides=SHORT)
    with pytest.raises(ZeroDivisionError), simulation:
        raise ZeroDivisionError
    assert simulation.result.ended == "failed"


def test_simulation_steps_only_inside_its_with_block():
    simulation = Simulation(LOSSY, overrides=SHORT)
    with pytest.raises(RuntimeError, match="within its `with` block"):
        simulation.step()
    with pytest.raises(RuntimeError, match="not over yet"):
        _ = simulation.result
    with simulation:
        simulation.step()
    with pytest.raises(RuntimeError, match="within its `with` block"):
        simulation.step()
    with pytest.raises(RuntimeError, match="runs once"):
        simulation.__enter__()


def test_bad_scenario_leaves_no_folder(tmp_path):
    with pytest.raises(BadInput):
        Simulation(LOSSY, overrides=["robots.flock.count=-1"], out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_folder_of_a_run_without_ticks_is_complete(tmp_path):
    with Simulation(LOSSY, overrides=SHORT, out=tmp_path / "run") as simulation:
        pass
    assert simulation.result.ticks == 0
    assert [finding for finding in verify(tmp_path / "run") if not finding.good] == []


def test_linked_scenario_finds_its_files_beside_the_target_of_the_link(tmp_path):
    swarm, links = tmp_path / "swarm", tmp_path / "links"
    swarm.mkdir()
    links.mkdir()
    files = {"still.py": STILL, "mine.toml": 'like = "epuck"\nname = "mine"\n', "scenario.toml": NAMES_FILES}
    for name, text in {**files, "walls.pgm": "P2 4 4 255\n" + "0 255 255 255\n" * 4}.items():
        (swarm / name).write_text(text)
    (links / "scenario.toml").symlink_to(swarm / "scenario.toml")
    (links / "folder").symlink_to(swarm)
    folders = swarm, links, links / "folder"
    assert len({tuple(run(folder / "scenario.toml").trajectory_sha256) for folder in folders}) == 1


@pytest.fixture
def _moved(monkeypatch):
    monkeypatch.setattr(simulation_module, "WallClock", FakeClock)


@pytest.mark.usefixtures("_moved")
def test_agents_in_this_process_are_paced_and_do_the_same():
    short = ["duration_s=2"]
    result = run(LOSSY, overrides=short, realtime=10)
    assert (result.mode, result.wall_time_s) == ("realtime", 0.2)
    assert (result.realtime.factor, result.realtime.missed_ticks) == (10, 0)
    assert result.trajectory_sha256 == run(LOSSY, overrides=short).trajectory_sha256


def test_real_time_that_is_not_kept_is_warned_of_and_counted(monkeypatch, capfd):
    monkeypatch.setattr(simulation_module, "WallClock", lambda: GoingClock(MS))
    result = run(LOSSY, overrides=["duration_s=2"], realtime=1e6)
    assert result.realtime.missed_ticks == 20
    assert result.realtime.worst_lag_s > 0
    assert "does not keep up with 1e+06 x real time" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "key", "expected"),
    [
        *(({"realtime": factor}, "realtime", "a factor above 0") for factor in (0, -1, float("nan"), "fast")),
        ({"realtime": 1, "overrides": ["run.watchdog_s=0"]}, "run.watchdog_s", "a number above 0"),
        ({"subtick": 0.001}, "subtick", "realtime with it"),
        ({"subtick": 0.0009, "realtime": 1}, "subtick", "0.001 s to a tick's 0.1 s"),
        ({"subtick": float("nan"), "realtime": 1}, "subtick", "0.001 s"),
        ({"subtick": 0.06, "realtime": 2}, "subtick", "to a tick's 0.05 s"),
    ],
)
def test_run_arguments_that_cannot_be_are_refused_by_name(arguments, key, expected):
    with pytest.raises(BadInput, match=expected) as refused:
        run(LOSSY, **arguments)
    assert key in (refused.value.where, refused.value.key)


def test_subtick_needs_a_radio_and_positions_held(tmp_path):
    bare = LOSSY.read_text().partition("[radio]")[0].replace("behaviours:Flocking", "behaviours:Diffusion")
    (tmp_path / "bare.toml").write_text(bare.replace("params = { separation_m = 0.8 }", ""))
    with refused_input(match="a scenario with a radio"):
        run(tmp_path / "bare.toml", realtime=1, subtick=0.01)
    with refused_input(key="radio.positions"):
        run(LOSSY, overrides=["radio.positions=interpolated"], realtime=1, subtick=0.01)


@pytest.mark.usefixtures("_moved")
def test_realtime_option_sets_the_factor(monkeypatch, capsys, tmp_path):
    command = ("run", "--realtime=20", LOSSY, "--set", "duration_s=0.3", "--out", tmp_path / "run")
    code, out, _ = called(monkeypatch, capsys, *command)
    assert (code, "x 20; " in out) == (0, True)


SCENARIO = scenario_from(changed("seed", 5), "mine.toml")


def test_seeds_are_how_many_a_range_without_its_end_or_a_list():
    assert seed_list("3") == seed_list(3) == seed_list(" 3 ") == (1, 2, 3)
    assert seed_list("4:7") == (4, 5, 6)
    assert seed_list("7,1,5") == seed_list([7, 1, 5]) == (7, 1, 5)
    assert seed_list("9,") == seed_list("9:10") == seed_list([9]) == (9,)


@given(st.lists(st.integers(0, 2**63 - 1), min_size=1, max_size=9, unique=True))
def test_seeds_written_as_a_list_are_read_back(seeds):
    assert seed_list(",".join(map(str, seeds)) + ",") == seed_list(seeds) == tuple(seeds)


@pytest.mark.parametrize(
    "seeds",
    ["0", "", "x", "0.5", "5:5", "9:1", "1,1", "-1,2", "1:99999999999999999999", "9" * 30, [], [1.5], [-1], [2**63]],
)
def test_seed_list_that_cannot_be_is_refused_by_its_option(seeds):
    with refused_input("--record-seeds"):
        seed_list(seeds, "--record-seeds")


@pytest.mark.parametrize(
    ("seed", "seeds", "chosen"),
    [(None, None, (5,)), (0, None, (0,)), (7, None, (7,)), (None, [3, 0], (3, 0)), (None, "3", (1, 2, 3))],
)
def test_seeds_are_those_requested_or_the_scenarios(seed, seeds, chosen):
    assert choose_seeds(SCENARIO, seed, seeds) == chosen


@pytest.mark.parametrize(("seed", "seeds", "where"), [(1, "2", "seed"), (-1, None, "seed"), (None, [], "seeds")])
def test_seeds_that_are_no_good_are_refused_by_their_option(seed, seeds, where):
    with refused_input(where):
        choose_seeds(SCENARIO, seed, seeds)


def test_arenas_beyond_the_limit_are_refused():
    assert len(choose_seeds(SCENARIO, None, MAX_ARENAS)) == MAX_ARENAS
    with refused_input(match="sweep takes more"):
        choose_seeds(SCENARIO, None, MAX_ARENAS + 1)


@pytest.mark.parametrize(
    ("runners", "count"), [(None, 0), ("none", 0), ("per-robot", 6), (1, 1), (6, 6), ("1", 1), ("6", 6)]
)
def test_runners_are_a_number_or_a_word(runners, count):
    assert runner_count(runners, 6) == count


@pytest.mark.parametrize(("value", "factor"), [(None, None), (1, 1.0), ("0.5", 0.5), (1e6, 1e6), ("1e-3", 0.001)])
def test_realtime_factor_may_be_text(value, factor):
    assert parse_factor(value) == factor


class TakenPlace(Observer):
    """Takes the place of the summary in a run folder, so that it cannot be written, as on a full disk."""

    def __init__(self, folder):
        self.folder = folder

    def end(self, last):
        (self.folder / "summary.json").mkdir()
        return {}


def test_lost_summary_raises_with_the_result_in_run_and_repeat(tmp_path):
    complete = run(LOSSY, overrides=SHORT, out=tmp_path / "complete")
    calls = {"run": partial(run, LOSSY, overrides=SHORT), "again": partial(repeat, tmp_path / "complete")}
    for name, call in calls.items():
        with pytest.raises(RecordFailed, match=r"summary\.json") as lost:
            call(out=tmp_path / name, observers=[TakenPlace(tmp_path / name)])
        assert lost.value.result.trajectory_sha256 == complete.trajectory_sha256


def test_lost_summary_raises_as_a_simulation_is_left_unless_an_error_ended_it(tmp_path, capsys):
    def simulation(folder) -> Simulation:
        return Simulation(LOSSY, overrides=SHORT, out=folder, observers=[TakenPlace(folder)])

    with pytest.raises(RecordFailed), simulation(tmp_path / "left") as opened:
        opened.run(5)
    assert opened.result.ticks == 5
    with pytest.raises(ZeroDivisionError), simulation(tmp_path / "failed"):
        raise ZeroDivisionError
    assert str(tmp_path / "failed" / "summary.json") in capsys.readouterr().err


def test_lost_summary_is_exit_code_1_of_repeat(tmp_path, monkeypatch, capsys):
    run(LOSSY, overrides=SHORT, out=tmp_path / "run")
    summary = tmp_path / "again" / "summary.json"

    def write_but_the_summary(path, text):
        if path == summary:
            raise OSError(errno.ENOSPC, "No space left on device")
        write_text(path, text)

    monkeypatch.setattr(record_folder, "write_text", write_but_the_summary)
    code, _, errors = called(monkeypatch, capsys, "repeat", tmp_path / "run", "--out", tmp_path / "again")
    assert code == 1
    assert errors.splitlines()[-1].startswith(f"error: {summary}")
