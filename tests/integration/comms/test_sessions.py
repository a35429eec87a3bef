import socket
import stat
import subprocess
import sys
from contextlib import ExitStack
from threading import Event

import zenoh

from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm, swarm_config
from swarmwire.comms.wire.sessions import (
    close_session,
    closed_after,
    listens_at,
    open_router,
    open_runner,
    open_world,
    unix_endpoint,
)
from tests.support.clocks import until
from tests.support.comms.radio import MODULES
from tests.support.refusals import refused_input
from tests.support.swarms import ANY_PORT, peers

NOBODY = "tcp/127.0.0.1:9"  # the discard port, on which nothing listens
# A session whose close takes long, as on a machine that is busy.
PROGRAM = """
import atexit, sys, threading
from swarmwire.comms.wire import ending
from swarmwire.comms.wire.sessions import close_session

class Slow:
    def __init__(self): self.closed, self.may = False, threading.Event()
    def close(self):
        self.may.wait()
        self.closed = True

session = Slow()
close_session(session, timeout_s=0.01)
print("done")
"""
WAITS = "atexit.register(lambda: print('closed' if session.closed else 'open')); "


def test_world_listens_at_several_endpoints_with_ports_of_the_system(tmp_path):
    unix = unix_endpoint(f"{tmp_path}/world")
    with closed_after(open_world([unix, "tcp/127.0.0.1:0"], runner_timeout_s=10.0)) as world:
        endpoints = listens_at(world)
        assert unix.removeprefix("unixsock-stream/") in " ".join(endpoints)
        tcp = next(endpoint for endpoint in endpoints if endpoint.startswith("tcp/"))
        assert not tcp.endswith(":0")
        for endpoint in (unix, tcp):
            with closed_after(open_runner(endpoint)):
                pass


def test_world_with_insecure_true_listens_at_all_addresses():
    with closed_after(open_world("tcp/0.0.0.0:0", 10.0, Network(insecure=True))) as world:
        assert listens_at(world)


def test_query_passes_two_routers_started_in_any_order():
    insecure = Network(insecure=True)
    with ExitStack() as opened:
        near = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", (), insecure)))
        far = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", listens_at(near), insecure)))
        runner = opened.enter_context(closed_after(open_runner(listens_at(far)[0])))
        world = opened.enter_context(closed_after(open_router("tcp/127.0.0.1:0", listens_at(near), insecure)))

        def answer(query: zenoh.Query) -> None:
            query.reply("here", b"yes")

        queryable = world.declare_queryable("here", answer)
        until(lambda: any(reply.ok for reply in runner.get("here", timeout=1.0)))
        queryable.undeclare()


def test_peers_that_list_one_another_are_linked_and_others_are_not():
    with peers(2) as (a, b):
        until(lambda: len(list(a.info.peers_zid())) == 1)
        until(lambda: [str(zid) for zid in b.info.peers_zid()] == [str(a.zid())])
        with closed_after(open_swarm(Network(listen=ANY_PORT))) as alone:
            assert not list(alone.info.peers_zid())


def test_swarm_session_opens_without_waiting_for_absent_peers():
    clock = WallClock()
    began_ns = clock.now_ns()
    session = open_swarm(Network(connect=(NOBODY,)))
    assert clock.now_ns() - began_ns < NS_PER_S
    close_session(session)


def test_endpoint_with_a_chosen_port_can_be_read_back():
    with peers(1) as (session,):
        (endpoint,) = endpoints_of(session, Network(listen=ANY_PORT))
        assert endpoint.startswith("tcp/127.0.0.1:")
        assert not endpoint.endswith(":0")
        fixed = Network(listen=(endpoint,))
        assert endpoints_of(session, fixed) == fixed.listen
        with refused_input(match=endpoint):
            open_swarm(fixed)


def test_swarm_session_without_listen_listens_nowhere():
    with closed_after(open_swarm(Network(connect=(NOBODY,)))) as session:
        assert swarm_config(Network(connect=(NOBODY,)))["listen"]["endpoints"] == []
        assert not list(session.info.peers_zid())


def test_multicast_session_listens_at_a_port_that_can_be_read_back():
    network = Network(multicast=True, insecure=True)
    config = swarm_config(network)
    assert config["listen"]["endpoints"] == ["tcp/0.0.0.0:0"]
    assert config["adminspace"]["enabled"] is True
    with peers(1) as (session,):  # multicast itself is not for tests: it may find others
        assert endpoints_of(session, network)[0].startswith("tcp/127.0.0.1:")


def test_invalid_certificate_is_refused_in_one_line(tmp_path):
    for name in ("ca", "pem", "key"):
        (tmp_path / name).write_text("nonsense")
        (tmp_path / name).chmod(stat.S_IRUSR)
    files = {"ca": tmp_path / "ca", "certificate": tmp_path / "pem", "key": tmp_path / "key"}
    with refused_input():
        open_swarm(Network(("tls/127.0.0.1:0",), **files))


class Stuck:
    """A session that zenoh cannot close in time."""

    def __init__(self, wait: Event | None = None) -> None:
        self._wait = wait

    def close(self) -> None:
        if self._wait is not None:
            self._wait.wait()
        raise zenoh.ZError("close operation timed out!")


def test_session_closes_twice():
    with peers(1) as (session,), closed_after(session):
        close_session(session)
        assert session.is_closed()


def test_session_that_cannot_close_in_time_stays_open_until_exit(caplog):
    caplog.set_level("INFO")
    with closed_after(Stuck()):
        pass
    assert "stays open until the process ends" in caplog.text
    wait = Event()
    close_session(Stuck(wait), timeout_s=0.01)
    wait.set()


def ended(program: str) -> tuple[int, str, str]:
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout, done.stderr


def test_end_now_exits_at_once_with_its_exit_code():
    assert ended(PROGRAM + "ending.end_now(3); sys.exit(4)") == (3, "done\n", "")


def test_end_now_returns_once_all_sessions_are_closed():
    closed = "session.may.set(); ending._closing_threads[0].join(); "
    assert ended(PROGRAM + closed + "ending.end_now(3); sys.exit(4)") == (4, "done\n", "")


def test_exit_waits_for_sessions_that_are_closing():
    # What is registered first is called last: by then the session is closed, or the wait was in vain.
    program = PROGRAM.replace("session = Slow()", "session = Slow()\n" + WAITS)
    end = "threading.Timer(0.05, session.may.set).start(); sys.exit(4)"
    assert ended(program + end) == (4, "done\nclosed\n", "")


def test_radio_parameters_import_without_numba():
    code = f"import sys, {', '.join(MODULES)}; sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_idle_connections_do_not_delay_a_runner():
    """Twice as many as zenoh lets wait for their handshake by itself, for which a runner would wait for 10 s."""
    network = Network(insecure=True)
    with ExitStack() as stack:
        world = stack.enter_context(closed_after(open_world(ANY_PORT, 2.0, network)))
        (endpoint,) = listens_at(world)
        host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
        for _ in range(200):
            stack.enter_context(socket.create_connection((host, int(port))))
        close_session(open_runner(endpoint, 5.0, network))
