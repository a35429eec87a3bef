"""Sessions of the robots' network: who is linked with whom, and that opening waits for nobody."""

import json
import stat
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from swarmwire.comms.clock import NS_PER_S, WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.closing import close_session
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.swarm_session import endpoints_of, open_swarm, swarm_config
from tests.support.swarms import ANY_PORT, peers
from tests.support.waiting import until

NOBODY = "tcp/127.0.0.1:9"  # the discard port, on which nothing listens


def test_peers_that_list_one_another_are_linked_and_others_are_not():
    with peers(2) as (a, b):
        until(lambda: len(list(a.info.peers_zid())) == 1)
        until(lambda: [str(zid) for zid in b.info.peers_zid()] == [str(a.zid())])
        alone = open_swarm(Network(listen=ANY_PORT))
        try:
            assert not list(alone.info.peers_zid())
        finally:
            close_session(alone)


def test_opening_does_not_wait_for_those_who_are_not_there():
    clock = WallClock()
    began_ns = clock.now_ns()
    session = open_swarm(Network(connect=(NOBODY,)))
    assert clock.now_ns() - began_ns < NS_PER_S
    close_session(session)


def test_closing_does_not_wait_long_for_peers_that_are_frozen():
    answers = threading.Event()
    frozen: Any = SimpleNamespace(close=answers.wait)
    try:
        close_session(frozen, patience_s=0.01)
    finally:
        answers.set()
    with peers(1) as (session,):
        close_session(session)
        assert session.is_closed()


def test_a_chosen_port_can_be_read_back_and_a_given_one_is_as_given():
    with peers(1) as (session,):
        (endpoint,) = endpoints_of(session, Network(listen=ANY_PORT))
        assert endpoint.startswith("tcp/127.0.0.1:")
        assert not endpoint.endswith(":0")
        given = Network(listen=(endpoint,))
        assert endpoints_of(session, given) == given.listen
        with pytest.raises(BadInput) as caught:
            open_swarm(given)
        assert endpoint in str(caught.value)
        assert "\n" not in str(caught.value)


def test_who_lists_none_listens_nowhere():
    session = open_swarm(Network(connect=(NOBODY,)))
    try:
        assert swarm_config(Network(connect=(NOBODY,)))["listen"]["endpoints"] == []
        assert not list(session.info.peers_zid())
    finally:
        close_session(session)


def test_who_is_to_be_found_by_multicast_listens_at_a_port_that_can_be_read_back():
    network = Network(multicast=True, insecure=True)
    config = swarm_config(network)
    assert config["listen"]["endpoints"] == ["tcp/0.0.0.0:0"]
    assert config["adminspace"]["enabled"] is True
    with peers(1) as (session,):  # multicast itself is not for tests: it may find others
        assert endpoints_of(session, network)[0].startswith("tcp/127.0.0.1:")


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


def test_a_certificate_that_is_none_is_refused_in_one_line(tmp_path):
    for name in ("ca", "pem", "key"):
        (tmp_path / name).write_text("nonsense")
        (tmp_path / name).chmod(stat.S_IRUSR)
    files = {"ca": tmp_path / "ca", "certificate": tmp_path / "pem", "key": tmp_path / "key"}
    with pytest.raises(BadInput) as caught:
        open_swarm(Network(("tls/127.0.0.1:0",), **files))
    assert "\n" not in str(caught.value)
