"""The recording of a real run holds what the run's own numbers say, of its radio too, in every layout."""

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from typer.testing import CliRunner

from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.deploy import Recording, RunFolder, run
from swarmwire.deploy.cli.app import app
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.deploy.joiners import Watcher
from tests.support.deploy.runs import LOSSY, ROOT, hastily, record_run, run_spread
from tests.support.refusals import refused_input

SIGNALS = ROOT / "scenarios" / "flocking-802154.toml"
JAMMED = ROOT / "scenarios" / "jammed.toml"
TABLES = ("radio_robots", "radio_distances", "radio_links")
EVENTS = [
    "duration_s=6",
    'events=[{at_s=1.0, do="kill", robots={group="flock", share=0.2}, for_s=2.0},'
    ' {at_s=2.0, do="blackout", robots={group="flock", share=0.1}, for_s=1.0}]',
]
STATING = """
from swarmwire.agent import Agent, Message, f4

class Beacon(Message):
    heading_rad: f4

class Stating(Agent):
    needs = ("compass",)

    def step(self, robot):
        robot.note(state="east" if abs(robot.compass.heading_rad) < 1.5 else "west")
        robot.radio.send(Beacon(heading_rad=robot.compass.heading_rad))
        robot.drive(linear_mps=0.1, angular_radps=0.5)
"""


class Keeper(Watcher):
    """Keeps every truth and the metrics of its tick."""

    def __init__(self):
        super().__init__()
        self.metrics, self._metrics = [], Metrics()

    def begin(self, static):
        self._metrics.begin(static)

    def see(self, truth):
        super().see(truth)
        self._metrics.see(truth)
        self.metrics.append({name: values.copy() for name, values in self._metrics.latest.items()})


@pytest.mark.parametrize("named", ["my_swarm", "my_swarm/scenario.toml", "other.toml"])
def test_default_folder_has_the_name_of_the_scenario_or_of_its_folder(tmp_path, monkeypatch, named):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_swarm").mkdir()
    for file in ("my_swarm/scenario.toml", "other.toml"):
        (tmp_path / file).write_text(LOSSY.read_text())
    assert called("run", named, "--set", "duration_s=0.2", "--no-rrd", "--quiet").exit_code == 0
    [folder] = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("other-s1-" if named == "other.toml" else "my_swarm-s1-")


def test_recorded_tables_equal_the_observers_view_and_the_summary(tmp_path):
    (tmp_path / "stating.py").write_text(STATING)
    folder, keeper = tmp_path / "run", Keeper()
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(LOSSY.read_text())
    agent = ["robots.flock.agent=stating.py:Stating", "robots.flock.params={}"]
    with hastily():
        result = record_run(folder, scenario, observers=[keeper], seeds=[3, 8], overrides=[*EVENTS, *agent])
    recorded = RunFolder(folder)
    assert all(finding.good for finding in verify(folder)), verify(folder)

    for arena, of_arena in enumerate(result.arenas):
        rows = slice(arena * 20, arena * 20 + 20)
        ticks = recorded.ticks(arena)
        pose = np.array([truth.pose[rows] for truth in keeper.truths], np.float32)
        for index, column in enumerate(("x_m", "y_m", "heading_rad")):
            assert np.array_equal(ticks[column].to_numpy(), pose[:, :, index])
        assert ticks["alive"].to_list() == [truth.alive[rows].tolist() for truth in keeper.truths]
        states = [[truth.states[code] for code in truth.state[rows]] for truth in keeper.truths]
        assert ticks["state"].to_list() == states
        assert {"east", "west"} <= {state for row in states for state in row}
        for name, statistics in of_arena.metrics.items():
            values = [measured[name][arena] for measured in keeper.metrics]
            assert ticks[name].to_list() == [None if np.isnan(value) else value for value in values]
            assert ticks[name].to_list()[-1] == statistics.final
        counted = recorded.packets(arena).group_by("fate").agg(pl.col("receivers").sum()).rows()
        radio = of_arena.radio
        without_rows = (FATE_NAMES[Fate.OUT_OF_RANGE], FATE_NAMES[Fate.IN_FLIGHT])
        assert dict(counted) == {f: n for f, n in radio.fates.items() if n and f not in without_rows}
        assert {"received", "lost", "blackout"} <= dict(counted).keys()
        distance_m = recorded.packets(arena)["distance_m"].drop_nulls().to_numpy()
        assert 0.0 < distance_m.min() < distance_m.max() <= 2.0  # of this scenario's radio
        assert ticks["received"].sum() == radio.fates["received"]
    happened = [(event.tick, event.do, event.ended, event.robots[0]) for event in result.events]
    assert recorded.events(0).select("tick", "do", "ended", "robots").rows() == happened
    assert len(happened) == 4


@pytest.mark.parametrize("scenario", [LOSSY, SIGNALS], ids=lambda path: path.stem)
def test_tables_of_packets_and_radio_are_the_same_in_every_layout(tmp_path, scenario):
    def recorded(name: str, runners: int | None = None, **seeds) -> RunFolder:
        record = Recording(packets=0.1, links=True, rrd=False)
        run_spread(scenario, runners, out=tmp_path / name, record=record, overrides=["duration_s=3"], **seeds)
        assert all(finding.good for finding in verify(tmp_path / name))
        return RunFolder(tmp_path / name)

    def packets(folder: RunFolder, arena: int = 0) -> pl.DataFrame:
        return folder.packets(arena).drop("arena").sort("sender", "sequence", "receiver", maintain_order=True)

    alone, parts, others = recorded("alone", seed=3), recorded("parts", 3, seed=3), recorded("others", seeds=[9, 3])
    assert alone.summary["record"]["packets"]["share"] == 0.1
    assert 0 < len(packets(alone)) < 0.2 * alone.summary["radio"]["intended"]
    assert packets(alone).equals(packets(parts))
    assert packets(alone).equals(packets(others, 1))
    for table in TABLES:
        assert len(getattr(alone, table)()) > 0
        assert_frame_equal(getattr(alone, table)(), getattr(parts, table)())


def test_jammed_packets_are_counted_for_sender_receiver_and_link(tmp_path):
    record, short = Recording(links=True, rrd=False), ["duration_s=2", "events.0.at_s=0.5"]
    radio = run(JAMMED, overrides=short, out=tmp_path / "run", record=record).radio
    folder = RunFolder(tmp_path / "run")
    robots, links = folder.radio_robots(), folder.radio_links()
    jammed = radio.fates["jammed"]
    assert jammed > 0
    assert robots["as_sender_jammed"].sum() == robots["as_receiver_jammed"].sum() == jammed
    assert links.filter(links["fate"] == "jammed")["packets"].sum() == jammed


def test_recorded_packets_include_those_of_a_tick_that_failed(tmp_path):
    agent = tmp_path / "stating.py"
    agent.write_text(STATING.replace("robot.drive(", "1 / (robot.time_s < 0.45)\n        robot.drive("))
    overrides = ["duration_s=2", f"robots.flock.agent={agent}:Stating", "robots.flock.params={}"]
    record = Recording(packets=1.0, links=True, rrd=False)
    with pytest.raises(SwarmwireError, match="ZeroDivisionError"):
        run(LOSSY, overrides=overrides, out=tmp_path / "run", record=record)
    folder = RunFolder(tmp_path / "run")
    summary = folder.summary
    assert (summary["ended"], summary["ticks"]) == ("failed", 5)
    received, tables = pl.col("fate") == "received", (folder.packets(), folder.radio_links())
    counts = len(tables[0].filter(received)), tables[1].filter(received)["packets"].sum()
    assert counts == (summary["radio"]["fates"]["received"],) * 2
    assert folder.radio_robots()["as_receiver_received"].sum() == counts[0] > 0


def called(*arguments):
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_commands_record_links_and_draw_delivery_over_distance(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    folder = tmp_path / "run"
    ended = called("run", LOSSY, "--set", "duration_s=2", "--links", "--out", folder)
    assert ended.exit_code == 0
    for name in ("age_of_information", "throughput", "airtime"):
        assert name in ended.output
    assert len(RunFolder(folder).radio_links()) > 0
    ended = called("export", folder, "--to", folder / "pdr.png", "--kind", "delivery", "--size", "300")
    assert (ended.exit_code, ended.output.startswith(f"written: {folder}/pdr.png (")) == (0, True)
    assert (folder / "pdr.png").stat().st_size > 1000


def test_links_without_a_place_for_them_are_refused():
    with refused_input("links"):
        Recording(links=True, tables=False)
    refusal = called("repeat", "nowhere", "--links").exception
    assert isinstance(refusal, BadInput)
    assert refusal.where == "--links"


@pytest.mark.parametrize("preset", PRESETS)
def test_radio_presets_all_carry_a_flock(preset: str):
    radio = f'radio={{preset="{preset}",measures={{range={{}},bearing={{}}}},max_payload_bytes=6}}'
    result = run(SIGNALS, overrides=["duration_s=1", "robots.flock.count=5", radio])
    assert result.radio.sent > 40
    assert sum(result.radio.fates.values()) == result.radio.intended == 4 * result.radio.sent
