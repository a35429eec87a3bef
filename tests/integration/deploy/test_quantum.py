"""Runs in real time with a quantum, over real processes: what happens, in no set time, and the same again."""

import json
from pathlib import Path
from typing import Any

import msgpack
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Result, repeat, run
from swarmwire.deploy.record.inputs import LENGTH_BYTES, WITHIN
from swarmwire.metrics.record.names import INPUTS
from tests.support.deploy.commands import LOSSY, swarmwire

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
        for packet in robot.radio.heard(News):
            self.passed += 1
            robot.radio.send(Passed(number=packet.message.number))
"""
OF_FIVE = 'robots = { group = "flock", count = 5 }'
EVENTS = f"""[
    {{ do = "kill", {OF_FIVE}, at_s = 0.5, for_s = 0.7 }},
    {{ do = "blackout", {OF_FIVE}, at_s = 0.8, for_s = 0.5 }},
]"""


@pytest.fixture
def relays(tmp_path) -> list[str]:
    (tmp_path / "relay.py").write_text(RELAY)
    return [
        f"robots.flock.agent={tmp_path / 'relay.py'}:Relay",
        "robots.flock.params={}",
        "duration_s=2",
        "radio.latency_s=0.003",
    ]


def frames_of(folder: Path) -> list[dict[str, Any]]:
    data, found = (folder / INPUTS).read_bytes(), list[dict[str, Any]]()
    while data:
        stop = LENGTH_BYTES + int.from_bytes(data[:LENGTH_BYTES], "little")
        found.append(msgpack.unpackb(data[LENGTH_BYTES:stop]))
        data = data[stop:]
    return found


def checked(result: Result, runners: int) -> None:
    """What holds of every such run."""
    assert (result.mode, result.runners, result.ended, result.ticks) == ("realtime", runners, "duration", 20)
    assert result.radio is not None
    assert sum(result.radio.fates.values()) == result.radio.intended
    assert result.radio.fates["heard"] > 0
    assert result.realtime is not None
    assert result.realtime.quantum_s == 0.002
    assert result.realtime.delivery is not None
    assert result.realtime.delivery.count >= result.radio.fates["heard"]
    assert result.realtime.tick_jitter is not None
    assert result.realtime.tick_jitter.count == 19


@pytest.mark.parametrize("runners", [0, 2])
def test_packets_cross_between_ticks_fates_add_up_and_the_run_is_the_same_again(tmp_path, relays, runners):
    folder = tmp_path / "run"
    setting = [*relays, f"events={EVENTS}"]
    result = run(LOSSY, overrides=setting, runners=runners or None, realtime=1, quantum=0.002, out=folder)
    checked(result, runners)
    assert result.inputs is not None
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, 20)
    came = [frame["arrays"][WITHIN] for frame in frames_of(folder) if WITHIN in frame["arrays"]]
    assert came
    summary = json.loads((folder / "summary.json").read_text())["realtime"]
    assert {"count", "p50_s", "p99_s", "worst_s"} == set(summary["delivery"]) == set(summary["tick_jitter"])
    assert json.loads((folder / "run.json").read_text())["quantum_s"] == 0.002
    repetition = repeat(folder, out=tmp_path / "again")
    assert repetition.same
    assert repetition.result.radio == result.radio
    assert repetition.result.inputs == result.inputs
    assert repeat(tmp_path / "again").same


def test_a_run_without_a_quantum_records_as_ever_and_older_records_are_repeated(tmp_path, relays):
    folder = tmp_path / "run"
    result = run(LOSSY, overrides=relays, runners=2, realtime=4, out=folder)
    assert result.realtime is not None
    assert result.realtime.quantum_s is None
    assert result.realtime.delivery is not None  # up to a tick late
    recorded = frames_of(folder)
    assert not any(WITHIN in frame["arrays"] for frame in recorded)
    older = [msgpack.packb({**frame, "v": 1}) for frame in recorded]
    data = b"".join(len(frame).to_bytes(LENGTH_BYTES, "little") + frame for frame in older)
    (folder / INPUTS).write_bytes(data)
    origin = json.loads((folder / "run.json").read_text())
    del origin["quantum_s"]
    (folder / "run.json").write_text(json.dumps(origin))
    assert repeat(folder).same


def test_a_record_that_contradicts_itself_is_refused(tmp_path, relays):
    folder = tmp_path / "run"
    run(LOSSY, overrides=relays, realtime=1, quantum=0.002, out=folder)
    recorded = frames_of(folder)
    at = next(i for i, frame in enumerate(recorded) if WITHIN in frame["arrays"])
    code, shape, numbers = recorded[at]["arrays"][WITHIN]
    recorded[at]["arrays"][WITHIN] = (code, shape, numbers[:-8] + (99).to_bytes(8, "little"))
    packed = [msgpack.packb(frame) for frame in recorded]
    (folder / INPUTS).write_bytes(b"".join(len(frame).to_bytes(LENGTH_BYTES, "little") + frame for frame in packed))
    with pytest.raises(BadInput, match="expected packets in the order in which they came"):
        repeat(folder)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"quantum": 0.001}, "expected --realtime with it"),
        ({"quantum": 0.0009, "realtime": 1}, "expected 0.001 s to a tick's 0.1 s"),
        ({"quantum": float("nan"), "realtime": 1}, "expected 0.001 s"),
        ({"quantum": 0.06, "realtime": 2}, "to a tick's 0.05 s"),
    ],
)
def test_a_quantum_that_cannot_be_is_refused(arguments, expected):
    with pytest.raises(BadInput, match=expected):
        run(LOSSY, **arguments)


def test_without_a_radio_there_is_nothing_between_ticks(tmp_path):
    bare = LOSSY.read_text().partition("[radio]")[0].replace("behaviours:Flocking", "behaviours:Diffusion")
    (tmp_path / "bare.toml").write_text(bare.replace("params = { separation_m = 0.8 }", ""))
    with pytest.raises(BadInput, match="expected a scenario with a radio"):
        run(tmp_path / "bare.toml", realtime=1, quantum=0.01)


def test_the_command_takes_a_quantum_and_tells_how_late_packets_were(tmp_path):
    arguments = ("--realtime", "--quantum", "0.005", "--set", "duration_s=1", "--out", tmp_path / "run")
    ended = swarmwire("run", LOSSY, *arguments)
    assert ended.returncode == 0, ended.stderr
    assert "in quanta of 5.0 ms" in " ".join(ended.stdout.split())
    assert "ticks began late" in ended.stdout
