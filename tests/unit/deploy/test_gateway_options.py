"""The options of gateways: each form is read, and what cannot be is refused in one line by its option and key."""

import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.deploy import Gateways, Simulation
from swarmwire.deploy.cli.actions.run import gateway_network, parse_gateways
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue, revoke
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.runs.gateways.gateways import as_gateways


def read(*texts: str, options: tuple[str, ...] = ()) -> Gateways:
    gateways = parse_gateways(texts, options, None, None)
    assert gateways is not None
    return gateways


def refused(call: Any) -> BadInput:
    with pytest.raises(BadInput) as caught:
        call()
    assert "\n" not in str(caught.value)
    return caught.value


def test_gateway_text_has_an_optional_group_and_address() -> None:
    assert read("epuck2").kinds == {"": "epuck2"}
    assert read("a=epuck2@127.0.0.1:1000", "ros2").kinds == {"a": "epuck2@127.0.0.1:1000", "": "ros2"}
    assert read("ros2@tcp/10.0.0.1:7447?x=1").kinds == {"": "ros2@tcp/10.0.0.1:7447?x=1"}


def test_options_are_read_as_toml_and_else_as_texts() -> None:
    read_options = read("ros2", options=("rate=5", "kind=bridge", "a.lists=[1, 2]")).options
    assert read_options == {"rate": 5, "kind": "bridge", "a.lists": [1, 2]}


@pytest.mark.parametrize("text", ["", "=epuck2", "a=", "epuck2@", "@here"])
def test_other_forms_are_refused(text: str) -> None:
    assert refused(lambda: read(text)).where == "--gateway"


def test_group_with_two_gateways_is_refused() -> None:
    for first, second in (("a=epuck2", "a=ros2"), ("epuck2", "ros2")):
        error = refused(lambda pair=(first, second): read(*pair))
        assert (error.where, error.key) == ("--gateway", second)


@pytest.mark.parametrize(
    ("arguments", "flag"),
    [
        (([], ["rate=5"], None, None), "--gateway-set"),
        (([], [], "lab", None), "--swarm"),
        (([], [], None, Network(listen=("tcp/127.0.0.1:0",))), "--network"),
        (([], [], None, Network(insecure=True)), "--insecure"),
        (([], [], None, Network(certificate=Path("tracker.pem"))), "--certs"),
    ],
)
def test_options_of_gateways_without_a_gateway_are_refused(arguments: Any, flag: str) -> None:
    assert refused(lambda: parse_gateways(*arguments)).where == flag


def test_network_beyond_this_machine_needs_certificates_or_insecure() -> None:
    assert gateway_network(None, None, insecure=False) is None
    error = refused(lambda: gateway_network("tcp/0.0.0.0:7447", None, insecure=False))
    assert error.where == "--network"
    assert "expected --certs, or --insecure" in error.expected
    absent = refused(lambda: gateway_network("tls/0.0.0.0:7447", Path("none"), insecure=False))
    assert absent.where == "none"
    open_to_all = gateway_network("tcp/0.0.0.0:7447", None, insecure=True)
    assert open_to_all.warning


def test_revoked_names_are_those_given_and_those_of_the_authority(tmp_path) -> None:
    folder, clock = tmp_path / "ca", WallClock()
    begin_authority(folder, clock)
    issue(folder, [certificate_request("tracker"), certificate_request("flock-1")], 1, clock)
    revoke(folder, "flock-1", clock)
    for named in ((), ("flock-0",)):
        network = gateway_network("tls/127.0.0.1:0", folder, named, insecure=False)
        assert network.certificate == folder / "tracker.pem"
        assert network.revoked == ("flock-1", *named)
        gateways = as_gateways(Gateways({"": "epuck2"}, network=replace(network, revoked=named)))
        assert gateways.network == replace(network, revoked=(*named, "flock-1"))
    (folder / "certs.json").unlink()  # somebody else's CA
    network = gateway_network("tls/127.0.0.1:0", folder, ("flock-0",), insecure=False)
    assert network.revoked == ("flock-0",)
    unchanged = Gateways({"": "epuck2"}, network=network)
    assert as_gateways(unchanged) is unchanged
    assert refused(lambda: gateway_network(None, None, ["flock-0"], insecure=False)).where == "--revoked"


def test_python_takes_one_text_a_table_or_all_of_it() -> None:
    gateways = Gateways({"a": "ros2"})
    assert as_gateways("epuck2") == Gateways({"": "epuck2"})
    assert as_gateways({"a": "ros2"}) == as_gateways(gateways) == gateways
    assert as_gateways(None) is None


def test_sensors_of_a_gateway_are_computed_whatever_the_agent_needs(two_groups, scripted) -> None:
    simulation = Simulation(two_groups, gateways={"own": "scripted"})
    assert set(simulation.world.sensors["own"]) == {"proximity", "odometry", "imu"}
    assert set(simulation.world.sensors["other"]) == {"proximity", "compass"}


def test_options_reach_the_gateways_that_have_them_and_a_groups_own_count_more(two_groups, scripted) -> None:
    gateways = Gateways({"": "scripted"}, {"other.first": 7, "first": 3})
    with Simulation(two_groups, gateways=gateways, realtime=100) as simulation:
        assert [robot.address for robot in simulation.served.robots] == [f"scripted:{at}" for at in (3, 4, 7, 8, 9)]
        assert all(gateway.is_open for gateway in scripted)
    assert not any(gateway.is_open for gateway in scripted)


@pytest.mark.parametrize(
    ("gateways", "words"),
    [
        ({"othr": "scripted"}, "other (did you mean this?)"),
        ("scriptd", "scripted (did you mean this?)"),
        (Gateways({"": "scripted"}, {"fist": 1}), "first (did you mean this?)"),
        (Gateways({"": "scripted"}, {"first": 0}), "at least 1"),
        (Gateways({"own": "scripted"}, {"other.first": 1}), "group that has a gateway"),
        (Gateways({"": "scripted"}, swarm=""), "gateways.swarm: "),
        (Gateways({"": "scripted"}, swarm="lab/*"), "gateways.swarm: "),
    ],
)
def test_groups_kinds_and_options_that_are_not_there_are_refused(two_groups, scripted, gateways, words) -> None:
    assert words in str(refused(lambda: Simulation(two_groups, gateways=gateways)))


def test_several_arenas_and_runners_are_refused(two_groups, scripted) -> None:
    assert refused(lambda: Simulation(two_groups, gateways="scripted", seeds=[1, 2])).where == "seeds"
    assert refused(lambda: Simulation(two_groups, gateways="scripted", runners=2)).where == "runners"


def test_agent_behind_a_gateway_must_be_able_to_run_here(two_groups, scripted) -> None:
    broken = ["robots.own.agent='swarmwire.agent.behaviours:Nothing'"]
    assert refused(lambda: Simulation(two_groups, gateways="scripted", overrides=broken)).key == "robots.own.agent"


def test_folder_is_not_made_if_a_gateway_is_refused(two_groups, scripted, tmp_path) -> None:
    refused(lambda: Simulation(two_groups, gateways="scriptd", out=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_folder_is_not_made_if_the_network_address_is_taken(two_groups, scripted, tmp_path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        network = Network(listen=(f"tcp/127.0.0.1:{listener.getsockname()[1]}",))
        simulation = Simulation(two_groups, gateways=Gateways({"": "scripted"}, network=network), out=tmp_path / "run")
        assert "free" in refused(simulation.__enter__).expected
    assert not (tmp_path / "run").exists()
    assert not any(gateway.is_open for gateway in scripted)


def test_gateway_gets_the_robot_names_of_the_run(two_groups, scripted) -> None:
    with Simulation(two_groups, gateways={"other": "scripted"}, realtime=100):
        assert [gateway.names for gateway in scripted] == [("other-0", "other-1", "other-2")]


def test_network_without_certificates_is_warned_of_at_each_run(two_groups, scripted, capsys) -> None:
    network = Network(listen=("tcp/0.0.0.0:0",))
    assert refused(lambda: Simulation(two_groups, gateways=Gateways({"": "scripted"}, network=network)))
    gateways = Gateways({"": "scripted"}, network=replace(network, insecure=True))
    with Simulation(two_groups, gateways=gateways, realtime=100):
        assert "insecure" in capsys.readouterr().err


def test_body_overrides_of_a_group_behind_a_gateway_are_refused(two_groups: Path, scripted: Any) -> None:
    changed = ["robots.other.body_overrides.sensors.proximity.drop_out=0.5"]

    def begun() -> None:
        with Simulation(two_groups, gateways={"other": "scripted"}, realtime=100, overrides=changed):
            pass

    assert refused(begun).key == "robots.other.body_overrides"
