"""A run whose network has certificates: the agents of its robots join the medium, and hear one another."""

from pathlib import Path
from shutil import copy

from swarmwire.comms.clock import WallClock
from swarmwire.comms.wire.network import Network
from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.register import certificate_request
from swarmwire.deploy.gateways.gateways import Gateways
from tests.support.deploy.gateways.driven import DrivenRobots

SCENARIO = Path(__file__).parents[4] / "scenarios" / "robots" / "flocking-epuck2.toml"
ROBOTS = ("flock-0", "flock-1")
SHORT = ("robots.flock.count=2", "duration_s=3", "radio.loss=0")


def test_agents_with_certificates_of_their_names_hear_one_another_in_a_run(tmp_path):
    ca, out = tmp_path / "ca", tmp_path / "run"
    begin_authority(ca, WallClock())
    issue(ca, [certificate_request(name, ("127.0.0.1",)) for name in ("tracker", *ROBOTS)], 1, WallClock())
    proof = {"ca": ca / "ca.pem", "certificate": ca / "tracker.pem", "key": ca / "tracker.key"}
    gateways = Gateways({"": "epuck2"}, network=Network(("tls/127.0.0.1:0",), **proof))
    bare = Recording(tables=False, rrd=False)
    simulation = Simulation(SCENARIO, gateways=gateways, realtime=2.0, overrides=SHORT, out=out, record=bare)
    with simulation:
        for name in ROBOTS:  # where the settings that the run wrote look for them
            for ending in ("pem", "key"):
                copy(ca / f"{name}.{ending}", out / "robots")
        with DrivenRobots(simulation, None, broken=False):
            simulation.run()
    radio = simulation.result.radio
    assert radio is not None
    assert radio.fates["received"] > 10, radio
