"""Numbers that agents tell come to observers, records and metrics, the same however the agents are spread."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static, Truth
from swarmwire.deploy import Recording, repeat
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.layouts import PER_ROBOT, run_spread

AGREEING = """
import numpy as np

from swarmwire.agent import Agent, Message, VectorAgent, f8

class Estimate(Message):
    value: f8

class Agreeing(Agent):
    needs = ("compass",)
    value = None

    def step(self, robot):
        received = robot.radio.received(Estimate)
        if self.value is None:
            self.value = robot.compass.heading_rad
        self.value += 0.05 * sum(packet.message.value - self.value for packet in received)
        robot.note(state="agreeing", value=self.value)
        robot.radio.send(Estimate(value=self.value))
        robot.drive(0.0, 0.0)

class Turning(VectorAgent):
    needs = ("compass",)

    def step(self, robots, state):
        late = np.full(robots.n, robots.time_s >= 1.0)
        robots.note(value=robots.compass.heading_rad, rows=late & (robots.compass.heading_rad > 0))
        robots.drive(0.0, 0.4)
"""


LEAN = Recording(rrd=False)


class Kept(Observer):
    """Observer that keeps the numbers of all ticks, and how far they are apart."""

    def __init__(self) -> None:
        self.values: list[FloatArray | None] = []
        self.errors: list[float] = []
        self._metrics = Metrics(["consensus_error"])

    def begin(self, static: Static) -> None:
        self._metrics.begin(static)

    def see(self, truth: Truth) -> None:
        self._metrics.see(truth)
        self.errors.append(float(self._metrics.latest["consensus_error"][-1]))
        self.values.append(truth.value)


@pytest.fixture
def agents(tmp_path: Path) -> Path:
    (tmp_path / "agents.py").write_text(AGREEING)
    return tmp_path / "agents.py"


def kept(agents: Path, kind: str, runners: int | None, seeds: list[int], out: Path | None = None) -> Kept:
    seen = Kept()
    setting = [f"robots.flock.agent={agents}:{kind}", "robots.flock.params={}", "duration_s=3"]
    run_spread(LOSSY, runners, seeds=seeds, overrides=setting, observers=[seen], out=out, record=LEAN)
    return seen


def as_bytes(ticks: list[FloatArray | None]) -> list[bytes | None]:
    return [None if value is None else value.tobytes() for value in ticks]


@pytest.mark.parametrize("kind", ["Agreeing", "Turning"])
@pytest.mark.parametrize("runners", [3, PER_ROBOT])
def test_they_are_the_same_bit_for_bit_however_the_agents_are_spread(agents: Path, kind: str, runners: int) -> None:
    alone, spread = (kept(agents, kind, where, [2]) for where in (None, runners))
    assert as_bytes(spread.values) == as_bytes(alone.values)
    assert alone.values[-1] is not None
    assert np.isfinite(alone.values[-1]).any()


def test_they_are_the_same_beside_other_arenas(agents: Path) -> None:
    alone, beside = (kept(agents, "Agreeing", None, seeds) for seeds in ([2], [5, 2]))
    own = [None if value is None else value[len(value) // 2 :] for value in beside.values]
    assert as_bytes(own) == as_bytes(alone.values)
    assert beside.errors == alone.errors


def test_a_consensus_comes_to_less_and_less_disagreement(agents: Path) -> None:
    errors = kept(agents, "Agreeing", None, [2]).errors
    assert 0.0 < errors[-1] < 0.5 * errors[0]


def test_they_are_recorded_from_the_first_on_and_a_repetition_is_the_same(agents: Path, tmp_path: Path) -> None:
    seen, folder = kept(agents, "Turning", 2, [2, 3], tmp_path / "run"), tmp_path / "run"
    assert all(finding.good for finding in verify(folder)), verify(folder)
    table = RunFolder(folder).ticks(1)
    expected = [
        [None] * 20 if value is None else [None if np.isnan(one) else one for one in value[20:].tolist()]
        for value in seen.values
    ]
    assert table["value"].to_list() == expected
    assert seen.values[0] is None
    assert repeat(folder, out=tmp_path / "again", record=LEAN).same
    assert RunFolder(tmp_path / "again").ticks(1)["value"].to_list() == expected
