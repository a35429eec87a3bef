"""What another version of swarmwire wrote is refused where it comes in, in one line that says what was expected."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest

from swarmwire.agent import API_VERSION
from swarmwire.agent.loading import NoAgent, load_agent
from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.wire import frames
from swarmwire.deploy import RunFolder
from swarmwire.deploy.record.origin import read_origin
from swarmwire.metrics.record.formats import RUN_FORMAT, SUMMARY_FORMAT, TABLES_FORMAT
from swarmwire.world.crews.admission import Refused
from swarmwire.world.scenario.scenario_file import scenario_from
from tests.support.world.locksteps import two
from tests.tools.stable.recorded_run import recorded

AGENT = """
from swarmwire.agent import Agent
class Later(Agent):
    api = {version}
    def step(self, robot): ...
"""


def load_later(folder: Path, version: int) -> Any:
    (folder / "later.py").write_text(AGENT.format(version=version))
    return load_agent(f"{folder / 'later.py'}:Later")


def folder_with(folder: Path, name: str, version: int) -> RunFolder:
    (folder / name).write_text(json.dumps({**recorded()[name], "format": version}))
    return RunFolder(folder)


def packed(**values: Any) -> bytes:
    return msgpack.packb(values)


DOORS: dict[str, tuple[int, type[Exception], Callable[[Path, int], Any]]] = {
    "agent": (API_VERSION, NoAgent, load_later),
    "scenario": (1, BadInput, lambda _, v: scenario_from({"format": v}, "mine.toml")),
    "summary": (SUMMARY_FORMAT, BadInput, lambda at, v: folder_with(at, "summary.json", v).summary),
    "static": (TABLES_FORMAT, BadInput, lambda at, v: folder_with(at, "static.json", v).static),
    "tables": (TABLES_FORMAT, BadInput, lambda at, v: folder_with(at, "static.json", v).ticks()),
    "repetition": (RUN_FORMAT, BadInput, lambda at, v: read_origin(folder_with(at, "run.json", v).path)),
    "runner": (frames.VERSION, Refused, lambda _, v: two().join("a", packed(v=v))),
    "frame": (frames.VERSION, BadFrame, lambda _, v: frames.decode(packed(v=v, kind="", tick=0, arrays={}, values={}))),
}


@pytest.mark.parametrize("door", DOORS)
def test_another_version_is_refused_in_one_line(door, tmp_path):
    known, refusal, enter = DOORS[door]
    with pytest.raises(refusal) as caught:
        enter(tmp_path, known + 1)
    [line] = str(caught.value).splitlines()
    assert str(known) in line.replace(str(tmp_path), "")
    assert "expected" in line


@pytest.mark.parametrize(
    ("name", "expected", "enter"),
    [
        ("summary.json", "expected the summary of a run", lambda folder: folder.summary),
        ("static.json", "expected the static part of a run", lambda folder: folder.static),
        ("run.json", "expected what swarmwire writes at the start of a run", lambda folder: read_origin(folder.path)),
    ],
)
def test_a_file_of_a_run_without_its_version_is_refused_in_one_line(name, expected, enter, tmp_path):
    missing = {key: value for key, value in recorded()[name].items() if key != "format"}
    (tmp_path / name).write_text(json.dumps(recorded()[name]))
    assert enter(RunFolder(tmp_path))
    (tmp_path / name).write_text(json.dumps(missing))
    with pytest.raises(BadInput) as caught:
        enter(RunFolder(tmp_path))
    assert str(caught.value).startswith(f"{tmp_path / name}: {expected}")
    assert "\n" not in str(caught.value)


def test_an_agent_that_names_this_version_is_taken(tmp_path):
    assert load_later(tmp_path, API_VERSION).api == API_VERSION
