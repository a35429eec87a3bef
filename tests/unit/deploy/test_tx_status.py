"""What became of addressed packets reaches agents alike in every layout, and only where radios acknowledge."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Result, Simulation, run
from tests.support.agent.hosts import PLAYERS
from tests.support.deploy.runs import PER_ROBOT, run_spread

# One group acts in every third tick only, and some of the other are dead for a while.
SCENARIO = f"""
format = 1
name = "insisting"
duration_s = 3.0
arena = {{ size_m = [4.0, 4.0] }}

[robots]
often = {{ body = "epuck", count = 5, agent = "{PLAYERS}:Insisting" }}
seldom = {{ body = "epuck", count = 3, agent = "{PLAYERS}:Insisting", act_every_ticks = 3 }}

[radio]
preset = "ieee802154"
loss = 0.4
access = {{ method = "csma-802154", max_retries = 1 }}

[[events]]
at_s = 1.0
do = "kill"
robots = {{ group = "often", count = 2 }}
for_s = 0.5
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tx_status") / "insisting.toml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def local(scenario: Path) -> Result:
    return run(scenario, seeds=[1, 2])


@pytest.mark.parametrize("runners", [1, 3, PER_ROBOT])
def test_agents_that_send_again_do_so_alike_in_one_process_and_in_many(scenario: Path, local: Result, runners):
    found = run_spread(scenario, runners, seeds=[1, 2])
    assert found.trajectory_sha256 == local.trajectory_sha256


@pytest.mark.parametrize("runners", [None, 2])
def test_both_kinds_of_agent_do_the_same(scenario: Path, local: Result, runners):
    vector = [f"robots.{name}.agent={PLAYERS}:VectorInsisting" for name in ("often", "seldom")]
    found = run_spread(scenario, runners, seeds=[1, 2], overrides=vector)
    assert found.trajectory_sha256 == local.trajectory_sha256


def test_each_robot_is_told_of_packets_also_one_that_sends_to_itself(scenario: Path):
    """Or the tests above would say nothing: robots drive as fast as they were told of, and else stand."""
    with Simulation(scenario) as simulation:
        last = [simulation.step() for _ in range(30)][-1]
    assert (last.command[:, 0] > 0.0).all()


@pytest.mark.parametrize(
    "radio",
    [
        "{ range_m = 2.0 }",
        "{ preset = 'ieee802154', access = { method = 'none' } }",
        "{ preset = 'ieee802154', access = { method = 'aloha' } }",
        "{ preset = 'ieee802154', access = { acknowledged = false } }",
        None,
    ],
)
def test_an_agent_that_asks_is_refused_where_nothing_is_acknowledged(scenario: Path, tmp_path: Path, radio: str | None):
    path = tmp_path / "refused.toml"
    before, after = SCENARIO.split("[radio]")
    path.write_text(f"{before}\n[[events]]{after.split('[[events]]')[1]}")
    with pytest.raises(BadInput) as caught:
        run(path, overrides=[f"radio={radio}"] if radio else [])
    assert (caught.value.where, caught.value.key) == (str(path), "robots.often.agent")
    assert "'radio.tx_status'" in caught.value.expected
