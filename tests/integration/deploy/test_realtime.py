"""Runs in real time keep to the clock, and are rehearsed before they begin."""

import json
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import polars as pl
import psutil
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import Simulation, repeat, run
from swarmwire.deploy.runs import phases
from swarmwire.deploy.runs.config import Recording
from swarmwire.deploy.runs.real_time import warm_up
from swarmwire.deploy.runs.record.inputs import LENGTH_BYTES, WITHIN
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.swarm.order import Speed
from swarmwire.metrics.records.run_folder.layout import INPUTS
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World
from tests.support.deploy.runs import LOSSY, called, processes_of
from tests.support.refusals import refused_input

RELAY = """
from swarmwire.agent import Agent, Message, Robot, u2

class News(Message):
    number: u2

class Passed(Message):
    number: u2

class Relay(Agent):
    def __init__(self) -> None:
        self.steps = self.passed = 0

    def step(self, robot: Robot) -> None:
        self.hear(robot)
        self.steps += 1
        robot.note(value=self.passed)
        robot.drive(0.05, 0.01 * self.passed)
        if robot.draw.uniform("news") < 0.2:
            robot.radio.send(News(number=self.steps))

    def hear(self, robot: Robot) -> None:
        for packet in robot.radio.received(News):
            self.passed += 1
            robot.radio.send(Passed(number=packet.message.number))
"""
OF_FIVE = 'robots = { group = "flock", count = 5 }'
EVENTS = f"""[
    {{ do = "kill", {OF_FIVE}, at_s = 0.2, for_s = 0.4 }},
    {{ do = "blackout", {OF_FIVE}, at_s = 0.4, for_s = 0.3 }},
]"""
SUBTICK_S = 0.002
FLOCKING = Path(__file__).parents[3] / "scenarios" / "robots" / "flocking-epuck2.toml"


def runners_here() -> list[psutil.Process]:
    """The processes of the run that goes on in this one."""
    return processes_of(psutil.Process())


def relays(folder: Path) -> list[str]:
    (folder / "relay.py").write_text(RELAY)
    agent = [f"robots.flock.agent={folder / 'relay.py'}:Relay", "robots.flock.params={}"]
    return [*agent, "duration_s=1", "radio.latency_s=0.003", f"events={EVENTS}"]


def frames_of(folder: Path) -> list[dict[str, Any]]:
    """What was recorded of what came from outside, by tick."""
    data, frames = (folder / INPUTS).read_bytes(), list[dict[str, Any]]()
    while data:
        stop = LENGTH_BYTES + int.from_bytes(data[:LENGTH_BYTES], "little")
        frames.append(msgpack.unpackb(data[LENGTH_BYTES:stop]))
        data = data[stop:]
    return frames


@pytest.mark.parametrize("runners", [None, 2])
def test_packets_cross_between_ticks_fates_add_up_and_the_run_is_the_same_again(tmp_path, runners):
    folder = tmp_path / "run"
    result = run(LOSSY, overrides=relays(tmp_path), runners=runners, realtime=1, subtick=SUBTICK_S, out=folder)
    assert (result.mode, result.runners, result.ended, result.ticks) == ("realtime", runners or 0, "duration", 10)
    assert sum(result.radio.fates.values()) == result.radio.intended
    assert result.radio.fates["received"] > 0
    pace = result.realtime
    assert (pace.subtick_s, pace.tick_jitter.count) == (SUBTICK_S, 9)
    assert pace.delivery.count >= result.radio.fates["received"]
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, 10)
    assert any(WITHIN in frame["arrays"] for frame in frames_of(folder))
    summary = json.loads((folder / "summary.json").read_text())["realtime"]
    assert {"count", "p50_s", "p99_s", "worst_s"} == set(summary["delivery"]) == set(summary["tick_jitter"])
    assert json.loads((folder / "run.json").read_text())["subtick_s"] == SUBTICK_S
    repetition = repeat(folder, out=tmp_path / "again")
    assert repetition.same
    assert (repetition.result.radio, repetition.result.inputs) == (result.radio, result.inputs)
    assert repeat(tmp_path / "again").same
    contradicting(folder)
    with refused_input(match="packets in the order in which they came"):
        repeat(folder)


@pytest.mark.parametrize("stop", ["[]", '[{ metric = "pdr", at_least = 0.0 }]'])
def test_recorded_packets_include_those_received_within_the_last_tick(tmp_path, stop):
    options = {"overrides": ["duration_s=0.5", f"stop={stop}"], "record": Recording(packets=1.0, links=True)}
    result = run(LOSSY, realtime=1, subtick=SUBTICK_S, out=tmp_path, **options)
    received = pl.col("fate") == "received"
    packets, links = pl.read_parquet(tmp_path / "packets.parquet"), pl.read_parquet(tmp_path / "radio_links.parquet")
    robots = pl.read_parquet(tmp_path / "radio_robots.parquet")
    counts = len(packets.filter(received)), links.filter(received)["packets"].sum(), robots["as_sender_received"].sum()
    assert counts == (result.radio.fates["received"],) * 3
    assert counts[0] > 0
    assert all(finding.good for finding in verify(tmp_path)), verify(tmp_path)


def contradicting(folder: Path) -> None:
    """Have a tick's record tell of packets that were not there."""
    recorded = frames_of(folder)
    at = next(i for i, frame in enumerate(recorded) if WITHIN in frame["arrays"])
    code, shape, numbers = recorded[at]["arrays"][WITHIN]
    recorded[at]["arrays"][WITHIN] = (code, shape, numbers[:-8] + (99).to_bytes(8, "little"))
    packed = [msgpack.packb(frame) for frame in recorded]
    (folder / INPUTS).write_bytes(b"".join(len(frame).to_bytes(LENGTH_BYTES, "little") + frame for frame in packed))


def test_subtick_option_is_accepted_and_lateness_of_packets_printed(tmp_path, monkeypatch, capsys):
    arguments = ("--realtime", "1", "--subtick", "0.005", "--set", "duration_s=0.3", "--out", tmp_path / "run")
    code, out, errors = called(monkeypatch, capsys, "run", LOSSY, *arguments)
    assert code == 0, errors
    assert "in subticks of 5.0 ms" in " ".join(out.split())
    assert "ticks began late" in out


def flocking() -> tuple[World, Any]:
    """A world and its radio."""
    scenario = load_scenario(FLOCKING)
    world = World(scenario, [1], {"flock": ("radio.range",)})
    return world, new_medium(scenario, world, None)


def test_rehearsal_moves_robots_receives_packets_and_measures_metrics(monkeypatch) -> None:
    world, medium = flocking()
    fates, see = np.zeros(len(Fate), np.int64), Metrics.see

    def see_fates(self, truth) -> None:
        fates[:] += truth.tally.fates[0]
        see(self, truth)

    monkeypatch.setattr(Metrics, "see", see_fates)
    before = world.pose.copy()
    warm_up(world, medium, [Speed()])
    assert np.hypot(*(world.pose - before)[:, :2].T).min() > 0.0
    assert fates[Fate.RECEIVED] > 0


@pytest.mark.parametrize("subticks", [False, True])
def test_rehearsal_receives_packets_within_ticks_if_the_run_has_subticks(subticks, monkeypatch) -> None:
    world, medium = flocking()
    within, advance, tick_ns = list[int](), medium.advance, NS_PER_S // world.static.rate_hz

    def advanced(until_ns):
        received, tx_status = advance(until_ns)
        if until_ns % tick_ns:
            within.append(len(received))
        return received, tx_status

    monkeypatch.setattr(medium, "advance", advanced)
    warm_up(world, medium, [Speed()], subticks=subticks)
    assert (sum(within) > 0) == subticks


def test_rehearsal_comes_before_every_real_time_run_and_changes_nothing(monkeypatch) -> None:
    rehearsed = list[int]()
    monkeypatch.setattr(phases, "warm_up", lambda *arguments, **by: (rehearsed.append(1), warm_up(*arguments, **by)))
    results = list[list[str]]()
    for factor in (None, 1000.0):
        with Simulation(FLOCKING, realtime=factor) as simulation:
            simulation.run(5)
        results.append(simulation.result.trajectory_sha256)
    assert rehearsed == [1]
    assert results[0] == results[1]
