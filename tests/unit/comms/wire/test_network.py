"""Settings of networks: what is refused, what is safe, and what sessions are opened with."""

import json
from pathlib import Path

import pytest
import zenoh

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network, is_local
from swarmwire.comms.wire.robot_network import swarm_config
from swarmwire.comms.wire.sessions import (
    open_observed,
    open_observer,
    open_router,
    open_runner,
    open_world,
    unix_endpoint,
)

LOCAL = ["tcp/127.0.0.1:0"]
AFAR = "tls/10.0.0.5:7447"


@pytest.fixture
def files(tmp_path):
    """A folder with a CA, a certificate and a key that its owner alone may read."""
    for name in ("ca.pem", "robot.pem", "robot.key"):
        (tmp_path / name).write_text("-")
    (tmp_path / "robot.key").chmod(0o600)
    return tmp_path


def network(folder=Path(), **given) -> Network:
    return Network.from_mapping(given, "robot.toml", folder)


def proven(folder, **given) -> Network:
    return network(
        folder, **{"ca": "ca.pem", "certificate": "robot.pem", "key": "robot.key", "listen": [AFAR], **given}
    )


def refused(make, *args, **given) -> str:
    with pytest.raises(BadInput) as caught:
        make(*args, **given)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_within_this_machine_neither_certificates_nor_a_warning_are_needed():
    for listen in (LOCAL, ["tcp/[::1]:7447"], ["udp/localhost:1"], ["unixsock-stream//run/swarm.sock"]):
        made = network(listen=listen)
        assert made.listen == tuple(listen)
        assert made.warning is None
        assert not made.proves


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"listen": ["tcp/0.0.0.0:7447"]}, "network.listen"),
        ({"connect": ["tcp/10.0.0.5:7447"]}, "network.connect"),
        ({"connect": [*LOCAL, "tcp/base.local:7447"]}, "network.connect"),
        ({"multicast": True}, "network.multicast"),
    ],
)
def test_beyond_this_machine_it_takes_certificates_or_the_word_insecure(given, key):
    said = refused(network, **given)
    assert said.startswith(f"robot.toml: {key}: ")
    assert said.endswith("expected ca, certificate and key, or insecure = true")
    made = network(**given, insecure=True)
    assert made.warning is not None
    assert "insecure" in made.warning


def test_with_certificates_it_is_safe_if_every_endpoint_shows_them(files):
    made = proven(files, connect=["quic/10.0.0.7:7447"], multicast=True, revoked=["flock-9"])
    assert made.proves
    assert made.warning is None
    assert (made.ca, made.certificate, made.key) == tuple(files / n for n in ("ca.pem", "robot.pem", "robot.key"))
    assert made.revoked == ("flock-9",)
    said = refused(proven, files, connect=["tcp/10.0.0.7:7447"])
    assert said == 'robot.toml: network.connect: expected tls or quic with a certificate, got "tcp/10.0.0.7:7447"'
    assert "certificate" in refused(proven, files, connect=["tcp/10.0.0.7:7447"], insecure=True)


def test_certificates_are_asked_for_where_an_endpoint_needs_them():
    assert (
        refused(network, listen=[AFAR]) == f'robot.toml: network.listen: expected ca, certificate and key with "{AFAR}"'
    )


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
def test_files_go_together_and_must_be_there(files, name):
    given = {"ca": "ca.pem", "certificate": "robot.pem", "key": "robot.key", "listen": [AFAR]}
    del given[name]
    expected = f"robot.toml: network.{name}: is missing: ca, certificate and key go together"
    assert refused(network, files, **given) == expected
    expected = f"robot.toml: network.{name}: expected a file, {files / 'other'} is none"
    assert refused(network, files, **given, **{name: "other"}) == expected
    expected = f"robot.toml: network.{name}: expected a readable file, got"
    assert refused(network, files, **given, **{name: 300 * "x"}).startswith(expected)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o601])
def test_a_key_that_others_may_read_is_refused_with_the_cure(files, mode):
    (files / "robot.key").chmod(mode)
    said = refused(proven, files)
    assert said.startswith("robot.toml: network.key: ")
    assert said.endswith(f"chmod 600 {files / 'robot.key'}")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "network: expected listen, connect or multicast = true: nobody would be reached"),
        ({"listn": LOCAL}, "network.listn: unknown; expected one of listen"),
        ({"listen": "tcp/127.0.0.1:0"}, "network.listen: expected a list of texts, got 'tcp/127.0.0.1:0'"),
        ({"listen": [1]}, "network.listen: expected a list of texts, got [1]"),
        ({"multicast": 1}, "network.multicast: expected true or false, got 1"),
        ({"listen": LOCAL, "operator": ""}, "network.operator: expected a text, got ''"),
        ({"listen": LOCAL, "ca": 3}, "network.ca: expected a text, got 3"),
        ({"listen": ["127.0.0.1:0"]}, 'network.listen: expected endpoints such as "tls/10.0.0.5:7447", got "127.0'),
        ({"listen": ["tcp/127.0.0.1"]}, "network.listen: expected endpoints"),
        ({"listen": ["tcp/127.0.0.1:65536"]}, "network.listen: expected endpoints"),
        ({"listen": ["serial//dev/ttyS0"]}, "network.listen: expected endpoints"),
        ({"listen": ["unixsock-stream/here"]}, "network.listen: expected endpoints"),
    ],
)
def test_what_will_not_do_is_refused_in_one_line_with_its_key(given, said):
    assert refused(network, **given).startswith(f"robot.toml: {said}")


@pytest.mark.parametrize(
    ("endpoint", "local"),
    [
        ("tcp/127.3.2.1:5", True),
        ("tcp/[::1]:5", True),
        ("tcp/localhost:5", True),
        ("unixsock-stream//tmp/x", True),
        ("tcp/0.0.0.0:5", False),
        ("tcp/[::]:5", False),
        ("tcp/192.168.1.2:5", False),
        ("tcp/localhost.example.com:5", False),
    ],
)
def test_only_loopback_is_this_machine(endpoint, local):
    assert is_local(endpoint) is local


@pytest.mark.parametrize("network", [None, Network(), Network(revoked=("r1",))])
@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:0", "tls/127.0.0.1:0"])
def test_nobody_is_reached_beyond_this_machine_without_certificates(network, endpoint):
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
def test_how_long_somebody_may_be_frozen_before_its_link_is_cut(monkeypatch, opened, lease_s):
    configs: list[zenoh.Config] = []
    monkeypatch.setattr(zenoh, "open", configs.append)
    opened()
    assert int(configs[0].get_json("transport/link/tx/lease")) == lease_s * 1000


def test_with_certificates_nothing_else_is_spoken(tmp_path):
    made = Network(multicast=True, ca=tmp_path / "ca", certificate=tmp_path / "pem", key=tmp_path / "key")
    config = swarm_config(made, {"enabled": True})
    link = config["transport"]["link"]
    assert link["protocols"] == ["tls", "quic"]
    assert link["tls"]["enable_mtls"] is True
    assert config["listen"]["endpoints"] == ["tls/0.0.0.0:0"]
    assert config["scouting"]["multicast"] == {"enabled": True}
    assert config["access_control"] == {"enabled": True}
    json.dumps(config)
