"""Runs whose robots stand behind a scripted gateway."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarmwire.comms import plugins
from swarmwire.world.gateways import gateway
from tests.support.world.gateways.scripted import ScriptedGateway

TWO_GROUPS = """
format = 1
name = "two groups"
duration_s = 2.0

[arena]
size_m = [2.0, 2.0]

[robots.own]
body = "epuck2"
count = 2
agent = "swarmwire.agent.behaviours:Avoidance"

[robots.other]
body = "epuck2"
count = 3
agent = "swarmwire.agent.behaviours:Flocking"

[radio]
range_m = 1.5
measures = { range = {}, bearing = {} }
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A scenario of two groups, `own` and `other`."""
    path = tmp_path / "two.toml"
    path.write_text(TWO_GROUPS)
    return path


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> list[ScriptedGateway]:
    """The gateways of kind "scripted" that runs of this test make, in order."""
    point = EntryPoint("scripted", "tests.support.world.gateways.scripted:ScriptedGateway", gateway.GROUP)
    monkeypatch.setattr(plugins, "entry_points_of", lambda _: [point])
    made: list[ScriptedGateway] = []
    monkeypatch.setattr(ScriptedGateway, "made", made)
    return made
