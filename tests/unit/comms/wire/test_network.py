"""Settings of a network, and who may do what in it."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
import zenoh

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import (
    RunAccess,
    access_control,
    access_of,
    agents_access,
    observers_access,
    router_access,
)
from swarmwire.comms.wire.keys import EVERY_WORLD, Keys, ObserverKeys, SwarmKeys, run_of, runner_of
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import swarm_config
from swarmwire.comms.wire.sessions import (
    open_observed,
    open_observer,
    open_router,
    open_runner,
    open_world,
    unix_endpoint,
)
from tests.support.refusals import refused_input

LOCAL = ["tcp/127.0.0.1:0"]
AFAR = "tls/10.0.0.5:7447"
KEYS = SwarmKeys("lab")
ROBOTS = ("flock-0", "flock-1")
RUN_KEYS, SEEN = Keys("run1"), ObserverKeys("run1")
ACCESS = RunAccess(("a", "b", "gone"), ("wall",), ("alice",), ("gate",), ("gone",))
ANY_RUN = Keys("*")


@pytest.fixture
def files(tmp_path):
    """A folder with a CA, a certificate and a key that its owner alone may read."""
    for name in ("ca.pem", "robot.pem", "robot.key"):
        (tmp_path / name).write_text("-")
    (tmp_path / "robot.key").chmod(0o600)
    return tmp_path


def network(folder=Path(), **settings) -> Network:
    return Network.from_mapping(settings, "robot.toml", folder)


def proven(folder, **settings) -> Network:
    return network(
        folder, **{"ca": "ca.pem", "certificate": "robot.pem", "key": "robot.key", "listen": [AFAR], **settings}
    )


def test_network_on_this_machine_needs_no_certificates():
    for listen in (
        LOCAL,
        ["tcp/127.3.2.1:5"],
        ["tcp/[::1]:7447"],
        ["udp/localhost:1"],
        ["unixsock-stream//run/swarm.sock"],
    ):
        accepted = network(listen=listen)
        assert accepted.listen == tuple(listen)
        assert accepted.warning is None
        assert not accepted.proves


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        *(({"listen": [f"tcp/{address}:7447"]}, "network.listen") for address in ("0.0.0.0", "[::]", "192.168.1.2")),
        *(({"connect": [f"tcp/{host}:7447"]}, "network.connect") for host in ("10.0.0.5", "localhost.example.com")),
        ({"connect": [*LOCAL, "tcp/base.local:7447"]}, "network.connect"),
        ({"multicast": True}, "network.multicast"),
    ],
)
def test_network_beyond_this_machine_needs_certificates_or_insecure(settings, key):
    with refused_input("robot.toml", key):
        network(**settings)
    accepted = network(**settings, insecure=True)
    assert accepted.warning is not None
    assert "insecure" in accepted.warning


def test_network_with_certificates_requires_them_at_every_endpoint(files):
    accepted = proven(files, connect=["quic/10.0.0.7:7447"], multicast=True, revoked=["flock-9"])
    assert accepted.proves
    assert accepted.warning is None
    assert (accepted.ca, accepted.certificate, accepted.key) == tuple(
        files / n for n in ("ca.pem", "robot.pem", "robot.key")
    )
    assert accepted.revoked == ("flock-9",)
    for insecure in ({}, {"insecure": True}):
        with refused_input("robot.toml", "network.connect"):
            proven(files, connect=["tcp/10.0.0.7:7447"], **insecure)


def test_network_with_a_tls_endpoint_needs_certificates():
    with refused_input("robot.toml", "network.listen"):
        network(listen=[AFAR])


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
def test_network_certificate_files_must_exist_together(files, name):
    settings = {"ca": "ca.pem", "certificate": "robot.pem", "key": "robot.key", "listen": [AFAR]}
    del settings[name]
    for changed in ({}, {name: "other"}, {name: 300 * "x"}):
        with refused_input("robot.toml", f"network.{name}"):
            network(files, **settings, **changed)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o601])
def test_network_key_readable_by_others_is_refused(files, mode):
    (files / "robot.key").chmod(mode)
    with refused_input("robot.toml", "network.key", match=r"chmod 600 .*robot\.key$"):
        proven(files)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({}, "network"),
        ({"listn": LOCAL}, "network.listn"),
        *(({"listen": value}, "network.listen") for value in ("tcp/127.0.0.1:0", [1], ["127.0.0.1:0"])),
        *(({"listen": [f"tcp/127.0.0.1{port}"]}, "network.listen") for port in ("", ":65536")),
        *(({"listen": [value]}, "network.listen") for value in ("serial//dev/ttyS0", "unixsock-stream/here")),
        ({"multicast": 1}, "network.multicast"),
        *(({"listen": LOCAL, name: value}, f"network.{name}") for name, value in (("operator", ""), ("ca", 3))),
    ],
)
def test_network_settings_that_are_invalid_are_refused(settings, key):
    with refused_input("robot.toml", key):
        network(**settings)


@pytest.mark.parametrize("network", [None, Network(), Network(revoked=("r1",))])
@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:0", "tls/127.0.0.1:0"])
def test_sessions_beyond_this_machine_need_certificates(network, endpoint):
    openings = (
        lambda: open_world(endpoint, 10.0, network),
        lambda: open_observed(endpoint, network),
        lambda: open_router(endpoint, (), network),
        lambda: open_router("tcp/127.0.0.1:0", endpoint, network),
        lambda: open_runner(endpoint, 0.1, network),
        lambda: open_observer(endpoint, network),
    )
    for opening in openings:
        with pytest.raises(BadInput):
            opening()


@pytest.mark.parametrize(
    ("opened", "lease_s"),
    [
        (lambda: open_world(unix_endpoint("/tmp/w"), 1.0), 7 * 86_400),
        (lambda: open_runner(unix_endpoint("/tmp/w")), 7 * 86_400),
        (lambda: open_observed([unix_endpoint("/tmp/w")]), 7 * 86_400),
        (lambda: open_world("tcp/127.0.0.1:0", 1.0), 10),
        (lambda: open_world([unix_endpoint("/tmp/w"), "tcp/127.0.0.1:0"], 45.0), 45),
        (lambda: open_runner("tcp/127.0.0.1:1"), 60),
    ],
)
def test_session_lease_depends_on_the_endpoints(monkeypatch, opened, lease_s):
    configs: list[zenoh.Config] = []
    monkeypatch.setattr(zenoh, "open", configs.append)
    opened()
    assert int(configs[0].get_json("transport/link/tx/lease")) == lease_s * 1000


def test_zenoh_config_with_certificates_allows_only_tls_and_quic(tmp_path):
    accepted = Network(multicast=True, ca=tmp_path / "ca", certificate=tmp_path / "pem", key=tmp_path / "key")
    config = swarm_config(accepted, {"enabled": True})
    link = config["transport"]["link"]
    assert link["protocols"] == ["tls", "quic"]
    assert link["tls"]["enable_mtls"] is True
    assert config["listen"]["endpoints"] == ["tls/0.0.0.0:0"]
    assert config["scouting"]["multicast"] == {"enabled": True}
    assert config["access_control"] == {"enabled": True}
    json.dumps(config)


def rules_of(access: dict[str, Any], name: str, flow: str) -> list[dict[str, Any]]:
    """The rules that hold between this peer and the other of that name."""
    ids = [rule for policy in access["policies"] if name in policy["subjects"] for rule in policy["rules"]]
    return [rule for rule in access["rules"] if rule["id"] in ids and flow in rule["flows"]]


def keys_of(access: dict[str, Any], name: str, flow: str, message: str = "put") -> set[str]:
    """The keys that this name may have such messages of."""
    return {key for rule in rules_of(access, name, flow) if message in rule["messages"] for key in rule["key_exprs"]}


def test_access_control_lets_names_put_their_own_keys():
    access = access_control(KEYS, ROBOTS, "flock-0")
    assert keys_of(access, "flock-1", "ingress") == {KEYS.any_radio_of("flock-1"), KEYS.bridge_sent("flock-1")}
    assert keys_of(access, "tracker", "ingress") == {KEYS.any_pose, KEYS.bridge_received("*")}
    assert keys_of(access, "operator", "ingress") == set()


@pytest.mark.parametrize("other", ["flock-1", "tracker", "operator"])
def test_access_control_lets_a_peer_put_its_keys_to_all(other: str):
    access = access_control(KEYS, ROBOTS, "flock-0")
    assert keys_of(access, other, "egress") == {KEYS.any_radio_of("flock-0"), KEYS.bridge_sent("flock-0")}


def test_access_control_denies_by_default_with_one_name_per_subject():
    access = access_control(KEYS, ROBOTS, "tracker")
    assert (access["enabled"], access["default_permission"]) == (True, "deny")
    assert [subject["cert_common_names"] for subject in access["subjects"]] == [
        [name] for name in (*ROBOTS, "tracker", "operator")
    ]
    assert len({rule["id"] for rule in access["rules"]}) == len(access["rules"])


def test_access_control_uses_the_names_of_tracker_and_operator():
    access = access_control(KEYS, ROBOTS, "flock-0", tracker="vicon", operator="alice")
    assert keys_of(access, "vicon", "ingress") == {KEYS.any_pose, KEYS.bridge_received("*")}
    assert not rules_of(access, "tracker", "ingress")
    assert any("query" in rule["messages"] for rule in rules_of(access, "alice", "ingress"))


def test_access_control_omits_revoked_names():
    access = access_control(KEYS, ROBOTS, "flock-0", revoked=("flock-1", "nobody"))
    assert [subject["id"] for subject in access["subjects"]] == ["flock-0", "tracker", "operator"]
    assert not rules_of(access, "flock-1", "ingress") + rules_of(access, "flock-1", "egress")


def test_access_control_is_absent_without_certificates():
    assert access_of(Network(insecure=True), KEYS, ROBOTS, "flock-0") is None
    file = Path("flock-0.pem")
    network = Network(ca=file, certificate=file, key=file, operator="alice", tracker="vicon", revoked=("flock-1",))
    expected = access_control(KEYS, ROBOTS, "flock-0", "vicon", "alice", ("flock-1",))
    assert access_of(network, KEYS, ROBOTS, "flock-0") == expected


@pytest.mark.parametrize(
    ("robots", "name", "revoked", "expected"),
    [
        (("a", "*"), "a", (), "'*'"),
        (("a", "b/c"), "a", (), "'b/c'"),
        (("a", "tracker"), "a", (), "tracker: expected names that differ"),
        (("a", "a"), "a", (), "a: expected names that differ"),
        (("a",), "b", (), "expected the name of a robot, tracker or operator"),
        (("a",), "a", ("a",), "a: its certificate is revoked"),
    ],
)
def test_access_control_refuses_ambiguous_names(robots, name, revoked, expected):
    with refused_input(match=re.escape(expected)):
        access_control(KEYS, robots, name, revoked=revoked)


def test_runner_access_is_limited_to_its_own_keys() -> None:
    access = agents_access(RUN_KEYS, ACCESS)
    assert keys_of(access, "a", "ingress") == {RUN_KEYS.answer("a")}
    assert keys_of(access, "a", "egress") == {RUN_KEYS.frame("a")}
    assert keys_of(access, "a", "ingress", "query") == {RUN_KEYS.session_info("a"), RUN_KEYS.join("a")}
    assert keys_of(access, "a", "ingress", "liveliness_token") == {RUN_KEYS.alive("a")}


def test_agents_access_of_a_router_covers_named_runners() -> None:
    access = agents_access(RUN_KEYS, ACCESS)
    assert keys_of(access, "gate", "ingress") == {RUN_KEYS.answer("a"), RUN_KEYS.answer("b")}
    assert keys_of(access, "local", "ingress") == {RUN_KEYS.answer("*")}


def test_observer_access_includes_control_for_operators_only() -> None:
    access = observers_access(SEEN, ACCESS)
    for name in ("wall", "alice", "gate", "local"):
        assert keys_of(access, name, "egress") == {SEEN.truth}
        assert keys_of(access, name, "ingress") == set()
        controls = SEEN.control in keys_of(access, name, "ingress", "query")
        assert controls == (name != "wall")
        assert (SEEN.control in keys_of(access, name, "egress", "reply")) == controls


def test_router_access_separates_frames_from_answers() -> None:
    access = router_access(ACCESS)
    assert keys_of(access, "world", "ingress") == {ANY_RUN.frame("a"), ANY_RUN.frame("b")}
    assert keys_of(access, "world", "egress") == {ANY_RUN.answer("a"), ANY_RUN.answer("b")}
    assert keys_of(access, "a", "ingress") == {ANY_RUN.answer("a")}
    both = keys_of(access, "world", "ingress") | keys_of(access, "world", "egress")
    assert keys_of(access, "gate", "ingress") == both


@pytest.mark.parametrize(
    "access", [agents_access(RUN_KEYS, ACCESS), observers_access(SEEN, ACCESS), router_access(ACCESS)]
)
def test_access_denies_by_default_and_omits_revoked_names(access: dict[str, Any]) -> None:
    assert access["default_permission"] == "deny"
    assert {rule["permission"] for rule in access["rules"]} == {"allow"}
    assert "gone" not in str(access)


def test_access_rules_are_shared_by_equal_members() -> None:
    single, many = (observers_access(SEEN, RunAccess(observers=("a", "b", "c")[:count])) for count in (1, 3))
    assert many["rules"] == single["rules"]
    assert len({tuple(policy["rules"]) for policy in many["policies"] if policy["subjects"] != ["local"]}) == 1


@pytest.mark.parametrize(
    ("access", "fault"),
    [
        (RunAccess(runners=("*",)), "access"),
        (RunAccess(runners=("a/b",)), "access"),
        (RunAccess(runners=("a",), operators=("a",)), "expected each name once, for one purpose"),
        (RunAccess(runners=("world",)), "expected each name once, for one purpose"),
    ],
)
def test_access_refuses_wildcards_and_repeated_names(access: RunAccess, fault: str) -> None:
    for refuses in (lambda: agents_access(RUN_KEYS, access), lambda: observers_access(SEEN, access)):
        with pytest.raises(BadInput, match=fault):
            refuses()
    with pytest.raises(BadInput, match=fault):
        router_access(access)


def test_key_leads_back_to_its_runner_or_run():
    keys = Keys("run-1")
    of_runner = (keys.session_info, keys.join, keys.alive, keys.frame, keys.answer)
    assert {runner_of(key("flock-3")) for key in of_runner} == {"flock-3"}
    assert run_of(keys.world) == "run-1"
    assert Keys("*").world == EVERY_WORLD


def test_keys_differ_by_run_and_by_purpose():
    of_runners = {key for run in ("a", "b") for key in vars(Keys(run)).values()}
    of_observers = {key for run in ("a", "b") for key in vars(ObserverKeys(run)).values()}
    assert len(of_runners) == 2 * len(vars(Keys("a")))
    assert len(of_observers) == 2 * len(vars(ObserverKeys("a")))
    assert not of_runners & of_observers
