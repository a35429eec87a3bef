"""The process and its machine: kernels and their compiler, sockets of killed runs, refusals, and names of programs."""

import atexit
import errno
import os
import socket
import sys
import tempfile
from contextlib import ExitStack, closing
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import typer
from numba import njit
from rich.console import Console

from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.wire.sessions import PRIVATE
from swarmwire.deploy import machine as host
from swarmwire.deploy.cli import app as cli
from swarmwire.deploy.machine import KERNEL_CACHE, command_path, keep_kernels, refusal
from swarmwire.deploy.runs.compiling import COMPILING, report_compiling
from swarmwire.deploy.runs.live_address import SOCKET, STALE_S, local_endpoint
from tests.support.deploy.runs import called


@pytest.fixture
def at_exit(monkeypatch):
    """What is to be done when the process ends; the place of kernels is as before after the test."""
    registered = []
    monkeypatch.setenv(KERNEL_CACHE, "x")
    monkeypatch.delenv(KERNEL_CACHE)
    monkeypatch.setattr(atexit, "register", lambda act, *arguments, **_: registered.append((act, arguments)))
    yield registered
    for act, arguments in registered:
        act(*arguments)


def test_kernels_without_a_writable_cache_are_kept_for_this_process(monkeypatch, tmp_path, at_exit):
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(host, "CODE", tmp_path / "nowhere")
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))  # no folder can be made in it
    keep_kernels()
    folder = Path(os.environ[KERNEL_CACHE])
    assert folder.is_dir()
    keep_kernels()  # as does a process that this one starts
    assert os.environ[KERNEL_CACHE] == str(folder)
    assert len(at_exit) == 1
    assert at_exit[0][1] == (str(folder),)


def test_kernels_are_kept_in_the_users_cache_or_next_to_the_code(monkeypatch, tmp_path, at_exit):
    keep_kernels()
    monkeypatch.setattr(host, "CODE", tmp_path / "nowhere")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    keep_kernels()
    assert KERNEL_CACHE not in os.environ
    assert (tmp_path / "cache" / "numba").is_dir()


def add(a, b):
    return a + b


def test_compiling_is_reported_once_and_only_if_it_happens():
    out = StringIO()
    console = Console(file=out, width=200)
    one, other = njit(add), njit(add)
    with report_compiling(console, after_s=0.001):
        one(1, 2)
        one(1.0, 2.0)
    assert out.getvalue() == f"{COMPILING}\n"
    with report_compiling(console, after_s=0.001):
        one(3, 4)
    assert out.getvalue() == f"{COMPILING}\n"
    other(1, 2)  # afterwards
    assert out.getvalue() == f"{COMPILING}\n"


def test_compiling_that_is_long_is_reported_with_the_kernels_so_far():
    out = StringIO()
    with report_compiling(Console(file=out), after_s=1000.0):
        njit(add)(1, 2)
    assert out.getvalue() == ""
    with report_compiling(Console(file=out, width=200), after_s=0.0, interval_s=0.0):
        for _ in range(3):
            njit(add)(1, 2)
    first, *others = out.getvalue().splitlines()
    counts = [int(line.removesuffix(" kernels so far")) for line in others]
    assert first == COMPILING
    assert counts == sorted(counts)
    assert counts[-1] == 3


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
        with local_endpoint() as endpoint:
            names = {path.name.removeprefix(PRIVATE) for path in base.iterdir()}
            assert {"alive", "new", "empty"} < names
            assert "old" not in names
            assert endpoint.endswith(f"/{SOCKET}")


def test_socket_of_a_frozen_world_is_kept(base):
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
        with local_endpoint():
            assert folder.exists()


def test_machine_limits_are_refused_with_cause_and_remedy():
    files = str(refusal(OSError(errno.EMFILE, "Too many open files", "/x")))
    assert files.startswith("/x: Too many open files")
    assert "ulimit -n" in files
    assert "temporarily unavailable" in str(refusal(BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")))
    assert "raise the limit" in str(refusal(RuntimeError("can't start new thread")))
    assert "fewer robots" in str(refusal(MemoryError()))
    with pytest.raises(MemoryError) as error:
        np.empty(2**56)
    assert "Unable to allocate" in str(refusal(error.value))
    for mistake in (RuntimeError("wrong"), FileNotFoundError(errno.ENOENT, "x"), KeyError()):
        assert refusal(mistake) is None


def test_command_line_prints_machine_limits_and_raises_mistakes(monkeypatch, capsys):
    def raises(error):
        app = typer.Typer()

        @app.command()
        def fails():
            raise error

        monkeypatch.setattr(cli, "app", app)
        return called(monkeypatch, capsys)

    code, out, errors = raises(OSError(errno.EMFILE, "Too many open files"))
    assert (code, out, errors.count("\n")) == (1, "", 1)
    assert errors.startswith("error: Too many open files")
    with pytest.raises(RuntimeError, match="a mistake"):
        raises(RuntimeError("a mistake"))


@pytest.mark.parametrize(
    ("called", "name", "typed"),
    [
        ("here/bin/swarmwire", "swarmwire-agent", "bin/swarmwire-agent"),
        ("bin/swarmwire", "swarmwire-agent", "{root}/bin/swarmwire-agent"),
        ("here/bin/swarmwire", "other", "other"),
        ("here/mine.py", "swarmwire-agent", "swarmwire-agent"),
        ("path/swarmwire", "swarmwire-agent", "swarmwire-agent"),
    ],
    ids=["below the folder", "elsewhere", "not beside it", "from a program of others", "on PATH"],
)
def test_program_name_as_printed_can_be_typed(tmp_path, monkeypatch, called, name, typed):
    for folder in ("bin", "here/bin", "path"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "swarmwire-agent").touch(mode=0o755)
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    monkeypatch.setattr(sys, "argv", [str(tmp_path / called)])
    assert str(command_path(name)) == typed.format(root=tmp_path)
