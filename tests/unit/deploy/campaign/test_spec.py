"""Campaigns are checked at the door, at each of their points."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.design import vary_of
from swarmwire.deploy.campaign.spec import SweepSpec, plan_of


def plan(scenario, *texts, **asked):
    return plan_of(SweepSpec(scenario, (1, 2), tuple(vary_of(text) for text in texts), **asked))


def test_a_range_over_what_the_scenario_counts_gives_whole_numbers(scenario):
    (scenario.parent / "counting.py").write_text(
        "from swarmwire.agent import Agent\nclass Counting(Agent):\n    n: int = 3\n    x: float = 1.0\n"
        "    def step(self, robot): pass\n"
    )
    agent = (
        'robots.pair.agent="counting.py:Counting"',
        'events=[{at_s=0.1, do="kill", robots={group="pair", count=1}}]',
    )
    found = plan(
        scenario, "robots.pair.count=2:8:2", "robots.pair.params.n=1:3:2", "robots.pair.params.x=1:3:2",
        "time.rate_hz=10:20:2", "duration_s=1:2:2", "events.0.robots.count=1:2:2", overrides=agent,
    )  # fmt: skip
    assert [type(value) for value in found.points[0].values()] == [int, int, float, int, float, int]
    assert len(found.points) == 64


def test_responses_are_told_with_unit_and_kind(scenario):
    found = {of.column: of for of in plan(scenario).responses}
    assert found["min_gap.final"].unit == "m"
    assert {of.kind for of in found.values()} == {"number"}
    assert list(found)[:4] == ["order.final", "order.mean", "order.min", "order.max"]
    assert "radio.link_pdr" in found


def test_the_time_of_a_stop_says_of_what_and_how_long_it_must_hold(scenario):
    stop = 'stop={metric="order", at_least=0.5, hold_s=%s}'
    (held,) = (of for of in plan(scenario, overrides=(stop % 2.0,)).responses if of.column == "stop_time_s")
    assert (held.help, held.hold_s) == ("when this began to hold: order at least 0.5 for 2 s", 2.0)
    varied = plan(scenario, "stop.hold_s=1.0,3.0", overrides=(stop % 2.0,)).responses
    (held,) = (of for of in varied if of.column == "stop_time_s")
    assert (held.help, held.hold_s) == ("when this began to hold: what is to stop the run", 3.0)


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (["radio.losss=0,0.5"], r"--vary radio.losss=0,0.5: radio.losss: unknown key; .*loss \(did you mean this"),
        (["robots.pair.params.sepa=1,2"], r"--vary robots.pair.params.sepa=1,2: .*sepa: "),
        (["robots.par.count=1,2"], r"--vary robots.par.count=1,2: robots.par.body: "),
        (["robots.pair.count.x=1,2"], r"--vary robots.pair.count.x=1,2: .*robots.pair.count"),
        (["radio.loss=0.5,1.5"], r"--vary radio.loss=0.5,1.5: radio.loss: expected .*got 1.5"),
        (["robots.pair.agent=no.py:No"], r"--vary robots.pair.agent=no.py:No: robots.pair.agent: "),
        (["events.0.at_s=1,2"], r"--vary events.0.at_s=1,2: "),
        (["time.rate_hz=1,10"], r"--vary time.rate_hz=1: physics.steps: "),
        (["seed=1,2"], r"--vary seed=1,2: "),
    ],
)  # fmt: skip
def test_a_point_that_cannot_be_run_is_refused_in_a_line_that_names_what_varies(scenario, texts, told):
    with pytest.raises(BadInput, match=f"^{told}") as refused:
        plan(scenario, *texts)
    assert "\n" not in str(refused.value)


def test_other_arguments_are_checked_too(scenario):
    for asked, told in (
        ({"record_seeds": (3,)}, "--record-seeds: .*3"),
        ({"batch": 0}, "--batch: expected at least 1"),
        ({"overrides": ("radio.los=1",)}, "--set radio.los=1: "),
    ):
        with pytest.raises(BadInput, match=f"^{told}"):
            plan(scenario, **asked)
