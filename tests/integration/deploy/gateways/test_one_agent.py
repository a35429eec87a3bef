"""One agent file, unchanged, on robots of each kind: in process, a process per robot, and through their protocols."""

import pytest

from benchmarks.one_agent import CASES, emulated, through_gateway
from tests.support.deploy.gateways import outside

DURATION_S = 20.0
SEED = 2  # of the run through a gateway
MAX_MISSED = 0.1  # of the ticks: a machine that did not keep up tells nothing of the robots


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", CASES)
def test_robots_driven_through_their_protocol_come_to_what_emulated_ones_do(name: str) -> None:
    expected = emulated(CASES[name], DURATION_S)
    values, missed = through_gateway(CASES[name], DURATION_S, SEED)
    if missed > MAX_MISSED:
        pytest.skip(f"{missed:.0%} of the ticks missed: that tells of this machine, not of robots")
    assert not outside(values, expected, tuple(values)), values
