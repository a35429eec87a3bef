"""Robots that agents here play and robots that are driven from outside are one swarm in one air."""

from tests.support.deploy.gateways.driven import driven

MIXED = """
format = 1
name = "one flock, two ways"
duration_s = 16.0

[arena]
size_m = [3.0, 3.0]

[robots.here]
body = "epuck2"
count = 3
place = { how = "disc", radius_m = 0.5 }
agent = "swarmwire.agent.behaviours:Flocking"
params = { speed_mps = 0.05 }

[robots.outside]
body = "epuck2"
count = 3
place = { how = "disc", radius_m = 0.5 }
agent = "swarmwire.agent.behaviours:Flocking"
params = { speed_mps = 0.05 }

[radio]
range_m = 2.0
measures = { range = {}, bearing = {} }
"""


def test_they_find_one_heading_together(tmp_path) -> None:
    scenario = tmp_path / "mixed.toml"
    scenario.write_text(MIXED)
    result = driven(scenario, {"outside": "epuck2"}, tmp_path / "run", pace=4.0)
    assert result.facts.gateways == {"outside": "epuck2"}
    order = result.metrics["order"]
    assert (order.min or 0.0) < 0.6
    assert (order.final or 0.0) > 0.9
    assert result.radio is not None
    assert result.radio.sent > 6 * 16 * 10 * 0.8
