"""The private places of worlds' sockets: those of runs that were killed go with the next run, no others do."""

import os
import socket
import tempfile
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from swarmwire.comms.clock import WallClock, to_ns
from swarmwire.comms.wire.sessions import PRIVATE
from swarmwire.deploy.runners import SOCKET, STALE_S, local_endpoint


@pytest.fixture
def base(monkeypatch):
    """The folder of temporary files, whose path is short enough for a socket's."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield Path(folder)


def test_sockets_of_killed_runs_go_with_the_next_run_and_no_others(base):
    long_ago_ns = WallClock().utc_ns() - to_ns(STALE_S + 1.0)
    with ExitStack() as stack:
        for name, listens, is_old in (("old", False, True), ("alive", True, True), ("new", False, False)):
            folder = base / f"{PRIVATE}{name}"
            folder.mkdir()
            own = stack.enter_context(closing(socket.socket(socket.AF_UNIX)))
            own.bind(str(folder / SOCKET))
            if listens:
                own.listen()
            if is_old:
                os.utime(folder / SOCKET, ns=(long_ago_ns, long_ago_ns))
        (base / f"{PRIVATE}empty").mkdir()  # its run has not come so far
        with local_endpoint(None) as endpoint:
            here = {path.name.removeprefix(PRIVATE) for path in base.iterdir()}
            assert {"alive", "new", "empty"} < here
            assert "old" not in here
            assert endpoint.endswith(f"/{SOCKET}")


def test_a_world_that_is_frozen_keeps_its_socket(base):
    folder = base / f"{PRIVATE}frozen"
    folder.mkdir()
    with closing(socket.socket(socket.AF_UNIX)) as own, ExitStack() as stack:
        own.bind(str(folder / SOCKET))
        own.listen(1)
        os.utime(folder / SOCKET, ns=(0, 0))
        for _ in range(5):  # as many as may wait, and more
            caller = stack.enter_context(closing(socket.socket(socket.AF_UNIX)))
            caller.setblocking(False)
            caller.connect_ex(str(folder / SOCKET))
        with local_endpoint(None):
            assert folder.exists()
