"""Worlds, routers, runners and observers meet at endpoints that prove who is there, or that are of one machine."""

from contextlib import ExitStack

import pytest
import zenoh

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.closing import closed_after
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import (
    listens_at,
    open_observed,
    open_observer,
    open_router,
    open_runner,
    open_world,
    unix_endpoint,
)
from tests.support.waiting import until


def test_a_runner_asks_the_world_at_its_socket_and_is_answered(tmp_path):
    endpoint = unix_endpoint(f"{tmp_path}/world")

    def answer(query: zenoh.Query) -> None:
        query.reply("here", b"yes")

    with open_world(endpoint, runner_timeout_s=10.0) as world, open_runner(endpoint) as runner:
        asked = world.declare_queryable("here", answer)
        replies = [reply.ok.payload.to_bytes() for reply in runner.get("here", timeout=10.0) if reply.ok]
        asked.undeclare()
    assert replies == [b"yes"]


def test_nobody_answers_where_there_is_no_world(tmp_path):
    with pytest.raises(zenoh.ZError):
        open_runner(unix_endpoint(f"{tmp_path}/nobody"), connect_s=0.1)


def test_ports_that_the_system_chose_are_told_and_a_world_may_listen_at_several_places(tmp_path):
    unix = unix_endpoint(f"{tmp_path}/world")
    with closed_after(open_world([unix, "tcp/127.0.0.1:0"], runner_timeout_s=10.0)) as world:
        told = listens_at(world)
        assert unix.removeprefix("unixsock-stream/") in " ".join(told)
        tcp = next(endpoint for endpoint in told if endpoint.startswith("tcp/"))
        assert not tcp.endswith(":0")
        for endpoint in (unix, tcp):
            with closed_after(open_runner(endpoint)):
                pass


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


def test_who_says_that_it_is_insecure_may():
    with closed_after(open_world("tcp/0.0.0.0:0", 10.0, Network(insecure=True))) as world:
        assert listens_at(world)


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


def test_a_query_passes_two_routers_whichever_begins_first():
    insecure = Network(insecure=True)
    with ExitStack() as opened:
        near = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", (), insecure)))
        far = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", listens_at(near), insecure)))
        runner = opened.enter_context(closed_after(open_runner(listens_at(far)[0])))
        world = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", listens_at(near), insecure)))

        def answer(query: zenoh.Query) -> None:
            query.reply("here", b"yes")

        asked = world.declare_queryable("here", answer)
        until(lambda: any(reply.ok for reply in runner.get("here", timeout=1.0)))
        asked.undeclare()
