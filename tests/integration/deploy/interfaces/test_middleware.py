"""Each middleware between three robots of the experiment: state, map and commands arrive."""

import pytest

from examples.middleware.delivery import read_logs, results
from examples.middleware.node import TRANSPORTS
from tests.support.deploy.interfaces import needs_interfaces, needs_program
from tests.support.deploy.runs import ROOT, swarmwire

pytestmark = [needs_interfaces, needs_program("babeld")]
PACKAGES = {"dds": "cyclonedds", "dds-wifi": "cyclonedds", "mqtt": "paho"}
SHORT = {
    "duration_s": "17",
    "robots.team.count": "3",
    "robots.team.place": '{ how = "box", size_m = [8.0, 8.0], at = [15.0, 0.0] }',
    "events.0.at_s": "14",
    "events.0.for_s": "1",
}


@pytest.mark.parametrize(
    "name", [*(name for name in TRANSPORTS if name != "mqtt"), pytest.param("mqtt", marks=needs_program("mosquitto"))]
)
def test_robots_receive_state_map_and_commands(tmp_path, monkeypatch, name):
    if name in PACKAGES:
        pytest.importorskip(PACKAGES[name], reason="needs the group middleware")
    monkeypatch.setenv("START_S", "4")
    options = [f"--set={path}={value}" for path, value in {**SHORT, "robots.team.program.3": name}.items()]
    scenario = ROOT / "examples" / "middleware" / "two-rooms.toml"
    done = swarmwire("run", scenario, "--realtime", "1", "--no-rrd", "--quiet", "--out", tmp_path / "run", *options)
    assert done.returncode == 0, done.stderr
    for row in results(read_logs(tmp_path / "run")):
        assert (row["discovered"], row["pairs"]) == (row["pairs"], 6 if row["topic"] == "state" else 2)
