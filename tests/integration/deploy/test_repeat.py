"""Runs repeated."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner, Result

from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.deploy import Recording, Simulation, repeat, run
from swarmwire.deploy.campaigns.repetition import RepeatedRun
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.runs import backends
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.inputs import WITHIN, RecordedBackend
from swarmwire.deploy.runs.record.provenance import PARTS, module_digests
from swarmwire.metrics.records.run_folder.layout import DIGEST_BYTES, DIGESTS, INPUTS
from swarmwire.world.scenario.arena import MapTable
from swarmwire.world.scenario.motion import TraceMotion
from swarmwire.world.scenario.scenario import same_content
from swarmwire.world.scenario_file import load_scenario
from tests.integration.deploy.test_realtime import frames_of, runners_here
from tests.support.deploy.joiners import Watcher, interrupt
from tests.support.deploy.runs import LOSSY, ROOT
from tests.support.refusals import refused_input
from tests.support.world.locksteps import EncodedBackend

SHORT = ["duration_s=2"]
FILE_AGENT = """
from swarmwire.agent import Robots, Memory, VectorAgent

class Circler(VectorAgent):
    speed_mps: float = 0.05

    def step(self, robots: Robots, memory: Memory) -> None:
        robots.drive(self.speed_mps, 0.5)
"""
MINE = """
format = 1
name = "circles"
seed = 4
duration_s = 2
[arena]
size_m = [4, 4]
[robots.left]
body = "epuck"
count = 3
agent = "mine.py:Circler"
[robots.right]
body = "epuck"
count = 3
agent = "other/mine.py:Circler"
params = { speed_mps = 0.02 }
"""
TALKER = """
from swarmwire.agent import Agent, Message, Robot, f4

class Word(Message):
    heading_rad: f4

class Talker(Agent):
    needs = ("compass",)

    def step(self, robot: Robot) -> None:
        words = robot.radio.received(Word)
        robot.note(state="turning" if words else "waiting")
        robot.radio.send(Word(heading_rad=robot.compass.heading_rad))
        robot.drive(0.03, 0.1 * len(words) - 0.2)
"""


@pytest.fixture
def mine(tmp_path) -> Path:
    (tmp_path / "source" / "other").mkdir(parents=True)
    (tmp_path / "source" / "mine.py").write_text(FILE_AGENT)
    (tmp_path / "source" / "other" / "mine.py").write_text(FILE_AGENT.replace("0.5)", "-0.5)"))
    (tmp_path / "source" / "mine.toml").write_text(MINE)
    return tmp_path / "source" / "mine.toml"


def copied(folder: Path) -> dict[str, str]:
    return {file["path"]: file["what"] for file in json.loads((folder / "summary.json").read_text())["files"]}


@pytest.mark.parametrize("encoded", [False, True])
def test_repeat_gives_the_same_run_also_through_frames(tmp_path, monkeypatch, encoded):
    disrupted = ROOT / "scenarios" / "flocking-disrupted.toml"
    run(disrupted, overrides=["duration_s=2", "radio.loss=0.4"], seed=7, out=tmp_path / "run")
    if encoded:
        monkeypatch.setattr(backends, "LocalBackend", EncodedBackend)
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.changes == ()
    assert repetition.result.arenas[0].seed == 7
    assert not (tmp_path / "run" / "inputs").exists()


def test_scenario_in_the_run_folder_is_as_run_without_omitted_keys(tmp_path):
    run(LOSSY, overrides=[*SHORT, "radio.loss=0.45"], seed=9, out=tmp_path / "run")
    text = (tmp_path / "run" / "scenario.toml").read_text()
    assert text.startswith("# As run by swarmwire ")
    assert "flocking-lossy.toml" in text.splitlines()[0]
    assert str(ROOT) not in text
    assert "min_delivery" not in text
    as_run = load_scenario(LOSSY, [*SHORT, "radio.loss=0.45", "seed=9"])
    assert same_content(load_scenario(tmp_path / "run" / "scenario.toml"), as_run)


@pytest.mark.parametrize("scenario", sorted((ROOT / "scenarios").glob("*.toml")), ids=lambda path: path.stem)
def test_scenario_that_is_shipped_survives_python_and_being_written(tmp_path, scenario):
    as_read = load_scenario(scenario)
    changed = as_read.model_copy(update={"duration_s": 0.1})
    run(changed, out=tmp_path / "run", record=Recording(rrd=False, tables=False))
    again = load_scenario(tmp_path / "run" / "scenario.toml")
    assert again.duration_s == 0.1
    if changed.radio is not None and changed.radio.trace is not None:  # it lies in the folder now
        trace = replace(changed.radio.trace, file=f"files/{changed.radio.trace.file}")
        changed = changed.model_copy(update={"radio": replace(changed.radio, trace=trace)})
    if isinstance(changed.arena.map, MapTable):
        table = changed.arena.map.model_copy(update={"image": f"files/{changed.arena.map.image}"})
        changed = changed.model_copy(update={"arena": changed.arena.model_copy(update={"map": table})})
    robots = dict(changed.robots)
    for name, table in robots.items():
        if table.body.endswith(".toml"):
            robots[name] = table.model_copy(update={"body": f"files/{Path(table.body).name}"})
        if isinstance(table.motion, TraceMotion):
            motion = table.motion.model_copy(update={"file": f"files/{table.motion.file}"})
            robots[name] = table.model_copy(update={"motion": motion})
    assert same_content(again, changed.model_copy(update={"robots": robots}))
    assert not same_content(again, as_read)


def test_nav2_map_with_its_picture_and_buildings_are_copied(tmp_path, mine):
    (mine.parent / "maps").mkdir()
    Image.new("L", (80, 80), 254).save(mine.parent / "maps" / "hall.pgm")
    keys = {"image": "maps/hall.pgm", "resolution": 0.05, "origin": [-2, -2, 0], "negate": 0}
    (mine.parent / "hall.yaml").write_text(yaml.safe_dump({**keys, "occupied_thresh": 0.65, "free_thresh": 0.196}))
    (mine.parent / "yard.sdf").write_text(
        """<sdf version="1.9"><model name="m"><static>true</static><pose>1 1 0 0 0 0</pose><link name="l">
        <collision name="c"><geometry><box><size>0.5 0.5 1</size></box></geometry></collision></link></model></sdf>"""
    )
    run(mine, overrides=["arena.map=hall.yaml", "arena.buildings.file=yard.sdf"], out=tmp_path / "run")
    shutil.rmtree(mine.parent)
    roles = {"files/hall.yaml": "map", "files/hall.pgm": "map", "files/yard.sdf": "buildings"}
    assert roles.items() <= copied(tmp_path / "run").items()
    assert repeat(tmp_path / "run").same


def test_agent_files_are_copied_and_the_originals_are_not_needed(tmp_path, mine):
    run(mine, out=tmp_path / "run")
    roles = {"scenario.toml": "scenario", "files/mine.py": "agent", "files/mine-2.py": "agent"}
    assert copied(tmp_path / "run") == roles
    assert (tmp_path / "run" / "files" / "mine-2.py").read_text() == (mine.parent / "other" / "mine.py").read_text()
    shutil.rmtree(mine.parent)
    moved = (tmp_path / "run").rename(tmp_path / "moved")
    repetition = repeat(moved, out=tmp_path / "again")
    assert (repetition.same, repetition.changes) == (True, ())
    assert repeat(tmp_path / "again").same


def test_agent_file_that_was_edited_is_named_and_the_run_differs(tmp_path, mine):
    run(mine, out=tmp_path / "run")
    path = tmp_path / "run" / "files" / "mine.py"
    path.write_text(FILE_AGENT.replace("0.5)", "0.5 if robots.time_s < 0.95 else 0.6)"))
    repetition = repeat(tmp_path / "run")
    assert (repetition.same, repetition.first_difference) == (False, 10)
    assert [change.split()[0] for change in repetition.changes] == ["files/mine.py"]
    path.unlink()
    with refused_input(match="mine.py"):
        repeat(tmp_path / "run")


def test_installed_module_that_changed_is_named(tmp_path, mine, monkeypatch):
    package = tmp_path / "site" / "circling_agents"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("from circling_agents.circler import Circler as Circler\n")
    (package / "circler.py").write_text(FILE_AGENT)
    monkeypatch.syspath_prepend(tmp_path / "site")
    agents = [f"robots.{group}.agent=circling_agents:Circler" for group in ("left", "right")]
    run(mine, overrides=agents, out=tmp_path / "run")
    assert repeat(tmp_path / "run").changes == ()
    (package / "circler.py").write_text(FILE_AGENT + "# a word more\n")
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    (change,) = repetition.changes
    assert "circling_agents" in change


def test_parts_of_swarmwire_are_named_once_and_a_lone_module_is_its_file(tmp_path, monkeypatch):
    (tmp_path / "lone_circler.py").write_text(FILE_AGENT)
    monkeypatch.syspath_prepend(tmp_path)
    digests = module_digests(["swarmwire.agent.behaviours:Flocking", "lone_circler:Circler", "/some/where.py:Mine"])
    assert set(digests) == {*PARTS, "lone_circler"}
    (tmp_path / "beside.py").write_text("")
    assert module_digests(["lone_circler:Circler"])["lone_circler"] == digests["lone_circler"]
    (tmp_path / "lone_circler.py").write_text(FILE_AGENT + "#")
    assert module_digests(["lone_circler:Circler"])["lone_circler"] != digests["lone_circler"]


def test_versions_and_modules_of_a_run_are_compared_but_not_the_cpu(tmp_path):
    run(LOSSY, overrides=SHORT, out=tmp_path / "run")
    path = tmp_path / "run" / "run.json"
    origin = json.loads(path.read_text())
    origin["cpu"], origin["versions"]["numpy"] = "Z80", "1.0"
    origin["modules"]["swarmwire.world"] = "0" * 64
    path.write_text(json.dumps(origin))
    module, package = repeat(tmp_path / "run").changes
    assert "swarmwire.world" in module
    assert re.search(r"numpy.* 1\.0$", package)


def called(*arguments: str | Path) -> Result:
    """The command in this process, which has long imported all that it needs."""
    return CliRunner().invoke(app, ["repeat", *map(str, arguments)])


def test_repeat_command_prints_same_or_different_and_names_changes(tmp_path, mine):
    folder = tmp_path / "run"
    run(mine, out=folder)
    same = called(folder, "--out", tmp_path / "again")
    assert same.exit_code == 0
    assert "same run, bit for bit: 20 ticks" in same.stdout
    assert (tmp_path / "again" / "summary.json").exists()
    assert called(folder, "--quiet").stdout == ""
    path = folder / "files" / "mine.py"
    path.write_text(path.read_text().replace("0.5)", "0.6)"))  # of the same size, maybe within the same second
    other = called(folder)
    assert other.exit_code == 1
    assert "different run from tick 0" in other.stdout
    assert "files/mine.py" in other.stdout


def test_agent_with_random_numbers_of_its_own_is_suspected(tmp_path, mine):
    path = mine.parent / "mine.py"
    path.write_text("import random\n" + FILE_AGENT.replace("0.5)", "random.random())"))
    run(mine, out=tmp_path / "run")
    other = called(tmp_path / "run")
    assert other.exit_code == 1
    assert "random numbers" in other.stdout


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (shutil.rmtree, "there is none"),
        (lambda run: (run / "run.json").unlink(), "run.json"),
        (lambda run: (run / "run.json").write_text("{}"), "run.json"),
        (lambda run: (run / "summary.json").write_text("{"), "the summary of a run"),
        (lambda run: (run / "scenario.toml").unlink(), "scenario.toml"),
    ],
)
def test_folder_without_a_run_is_refused_in_one_line(tmp_path, mine, spoil, expected):
    run(mine, out=tmp_path / "run")
    spoil(tmp_path / "run")
    with refused_input(match=expected):
        RepeatedRun(tmp_path / "run")


@pytest.mark.parametrize(("logged", "recorded", "ticks"), [(True, False, 7), (True, True, 20), (False, False, 20)])
def test_killed_run_is_compared_as_far_as_it_came(tmp_path, mine, logged, recorded, ticks):
    """As SIGKILL leaves it: the folder of a run that was stepped, before it could write its summary."""
    with Simulation(mine, out=tmp_path / "run") as simulation:
        simulation.run(7)
        shutil.copytree(tmp_path / "run", tmp_path / "killed")
    assert (tmp_path / "killed" / DIGESTS).stat().st_size == 7 * DIGEST_BYTES
    if not logged:
        (tmp_path / "killed" / DIGESTS).unlink()
    repetition = repeat(tmp_path / "killed", out=tmp_path / "again" if recorded else None)
    assert repetition.result.ticks == ticks
    assert repetition.before is None
    assert repetition.compared == (7 if logged else 0)
    assert repetition.same is (True if logged else None)
    assert "summary.json" in (repetition.why_not_all or "")


def test_run_that_an_agent_ended_is_repeated_to_its_end(tmp_path, mine):
    path = mine.parent / "mine.py"
    failing = "        if robots.time_s > 0.45:\n            raise ValueError('enough')\n        robots.drive"
    path.write_text(FILE_AGENT.replace("        robots.drive", failing))
    with pytest.raises(AgentFailed):
        run(mine, out=tmp_path / "run")
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == 5
    assert re.search("same run.* 5 ticks.* failed", called(tmp_path / "run").stdout)


def test_record_that_cannot_be_written_does_not_end_the_run_and_is_counted(tmp_path):
    (tmp_path / "inputs").write_text("in the way")
    still = Actions(np.zeros(1, np.int64), np.ones(1, np.bool_), *np.zeros((3, 1)))
    standing: Any = SimpleNamespace(act=lambda *_: still, start=None, counts=dict, close=None)
    backend = RecordedBackend(standing, tmp_path, lambda tick: tick >= 2)
    for tick in range(5):
        backend.act(tick, {}, ReceivedPackets.none(), NO_TX_STATUSES)
    record = backend.record()
    assert (record.first_tick, record.ticks, record.ticks_not_recorded) == (2, 0, 3)


def talkers_in(folder: Path) -> list[str]:
    (folder / "talker.py").write_text(TALKER)
    return [f"robots.flock.agent={folder / 'talker.py'}:Talker", "robots.flock.params={}"]


@pytest.fixture
def talkers(tmp_path) -> list[str]:
    return talkers_in(tmp_path)


def still(truth: Truth) -> int:
    """How many robots are told to stand."""
    return int(np.count_nonzero(~truth.command.any(axis=1)))


def kill_one() -> None:
    """As the system does that is out of memory."""
    runners_here()[0].kill()


def freeze() -> None:
    runners_here()[0].suspend()


def thaw() -> None:
    runners_here()[0].resume()


def test_real_time_run_with_a_runner_frozen_for_a_while_is_repeated(tmp_path, talkers):
    """The watchdog stops its robots, which go on when it does."""
    watcher = Watcher(
        (lambda truth: not still(truth), freeze),
        (lambda truth: still(truth) >= 6, thaw),
        (lambda truth: not still(truth), interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.watchdog_s=0.2"]
    result = run(LOSSY, overrides=setting, runners=3, realtime=5, out=tmp_path / "run", observers=[watcher])
    assert (result.ended, result.lost_runners) == ("interrupted", ())
    assert len(result.realtime.watchdog_stops) >= 6
    assert result.realtime.late_answers or result.realtime.frames_dropped  # of the runner that was frozen
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, result.ticks)
    repetition = repeat(tmp_path / "run", out=tmp_path / "again")
    assert repetition.same
    assert repetition.result.radio == result.radio
    assert repetition.result.inputs == result.inputs
    assert repeat(tmp_path / "again").same
    with refused_input("runners"):
        repeat(tmp_path / "run", runners=2)


@pytest.mark.parametrize("realtime", [None, 10])
def test_run_that_lost_a_runner_for_good_is_repeated(tmp_path, talkers, realtime, capfd):
    watcher = Watcher(
        (lambda truth: truth.tick >= 5 and not still(truth), kill_one),
        *[(lambda truth: still(truth) == 5, lambda: None)] * 10,
        (lambda truth: still(truth) == 5, interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.on_runner_loss=dead", "run.watchdog_s=1000"]
    result = run(LOSSY, overrides=setting, runners=4, realtime=realtime, out=tmp_path / "run", observers=[watcher])
    assert (result.ended, result.counts["runners_lost"], len(result.lost_runners)) == ("interrupted", 1, 1)
    assert "(5 robots)" in result.lost_runners[0]
    assert "stand still" in capfd.readouterr().err
    stood = ~watcher.truths[-1].command.any(axis=1)
    assert not watcher.truths[-10].command[stood].any()
    # In lockstep the robots acted by scenario and seed alone until the loss.
    assert (result.inputs.first_tick > 5) is (realtime is None)
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == result.ticks


def test_run_whose_lost_runner_was_replaced_is_repeated(tmp_path, talkers, monkeypatch):
    takeovers: list[subprocess.Popen[bytes]] = []

    def take_over(_: RunWriter, text: str) -> None:
        command = text.partition("python ")[2].replace("NAME", "fresh").split()
        if not command:  # it is told, too, that the other came
            return
        takeovers.append(subprocess.Popen([sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE))

    monkeypatch.setattr(RunWriter, "report", take_over)
    setting = [*talkers, "duration_s=1.5", "run.on_runner_loss=wait", "run.runner_timeout_s=2"]
    watcher = Watcher((lambda truth: truth.tick >= 5, freeze))
    try:
        result = run(LOSSY, overrides=setting, runners=2, out=tmp_path / "run", observers=[watcher])
    finally:
        for process in takeovers:
            process.communicate()
    assert (len(takeovers), len(result.lost_runners), result.ended) == (1, 1, "duration")
    assert repeat(tmp_path / "run").same


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """The folder of a run in real time of ten ticks."""
    folder = tmp_path_factory.mktemp("recorded")
    run(LOSSY, overrides=[*talkers_in(folder), "duration_s=1"], runners=2, realtime=20, out=folder / "run")
    return folder / "run"


@pytest.fixture
def in_real_time(recorded, tmp_path) -> Path:
    """A copy, for one test to damage."""
    return copytree(recorded, tmp_path / "run")


def test_record_of_a_real_time_run_has_each_tick_and_nothing_between(recorded):
    frames = frames_of(recorded)
    assert len(frames) == 10
    assert not any(WITHIN in frame["arrays"] for frame in frames)
    assert repeat(recorded).same


def test_record_that_is_truncated_is_repeated_as_far_as_it_is_whole(in_real_time):
    data = (in_real_time / INPUTS).read_bytes()
    (in_real_time / INPUTS).write_bytes(data[:-10])
    repetition = repeat(in_real_time)
    assert (repetition.before, repetition.compared, repetition.same) == (None, 9, True)
    assert "9 of the run's 10" in (repetition.why_not_all or "")
    assert [change.split()[0] for change in repetition.changes] == [INPUTS]
    (in_real_time / "summary.json").unlink()
    assert repeat(in_real_time).result.ticks == 9


def test_record_that_is_missing_or_damaged_is_refused(in_real_time):
    data = bytearray((in_real_time / INPUTS).read_bytes())
    data[10] ^= 0xFF
    (in_real_time / INPUTS).write_bytes(data)
    with refused_input(match="the actions of a tick"):
        repeat(in_real_time)
    scenario = in_real_time / "scenario.toml"
    data[10] ^= 0xFF
    (in_real_time / INPUTS).write_bytes(data)
    scenario.write_text(scenario.read_text().replace("count = 20", "count = 19"))
    with refused_input(match="rows: expected robots of 19"):
        repeat(in_real_time)
    (in_real_time / INPUTS).unlink()
    with refused_input(match="external inputs"):
        repeat(in_real_time)
