"""The server that forks agent processes, reports their ends, and ends what they leave behind.

It is forked from the host before that opens its network session, so it has no threads; it imports the agents' code
once, for all processes. A process gets one socket to its host, and its robots only through that. It ends with its host
and with the fork server, for any agent; so do the programs that it started.
"""

import gc
import os
import resource
import select
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn, cast

from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.agent_process import serve
from swarmwire.agent.isolation import DEFAULT_ISOLATION, Isolation, IsolationFailed, adopt_orphans, end_with_parent
from swarmwire.agent.process_frames import MAX_MESSAGE, content, frame_kind, message, receive, send
from swarmwire.comms.base.errors import BadInput

LOAD, FORK, KILL, ENDED, ENTERED = range(5)  # frames of a host to its fork server, and the last two back
FORKED = b"s"  # with the socket to a process
CLOSES_MS = 200  # for a process that has closed its socket to end by itself
CLOSED = "closed its socket"
ORPHAN_ROUNDS = 50  # of ending what a process left behind, which may start more


class ForkServer:
    """The process that forks agent processes, as its host sees it.

    Attributes:
        missing: borders of the processes that this system does not allow, a line each.
        is_gone: whether the server has ended, and all processes with it.
    """

    def __init__(self, isolation: Isolation = DEFAULT_ISOLATION) -> None:
        """Fork it from this process, which must have no other thread; BadInput if the isolation is not possible."""
        self._socket, of_server = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._ended: dict[int, str] = {}  # how, by process
        self._reports: list[int] = []
        self.is_gone = False
        host = os.pidfd_open(os.getpid())
        self.pid = os.fork()
        if self.pid == 0:
            self._socket.close()
            end_with_parent(host)
            _exit_after(lambda: _serve_isolated(of_server, isolation))
        os.close(host)
        of_server.close()
        self.missing: list[str] = []
        entered = receive(self._socket)
        if not entered or frame_kind(entered) != ENTERED:
            raise BadInput("--isolate", "", "expected a fork server, which ended")
        fault, self.missing = content(entered)
        if fault:
            self.close()
            raise BadInput("--isolate", "", fault)

    def fileno(self) -> int:
        """The file that is readable once processes have ended."""
        return self._socket.fileno()

    def load(self, agents: Sequence[str]) -> None:
        """Import agents, whose processes then share the code; a missing one fails in its process."""
        send(self._socket, (message(LOAD, list(agents)),))

    def fork(self, processes: int) -> list[socket.socket]:
        """Fork so many processes, numbered on from 0; returns the sockets to them, whose first frame is `assign`.

        BadInput if this process may not open so many files; OSError if the server is gone.
        """
        send(self._socket, (message(FORK, processes),))
        sockets: list[socket.socket] = []
        for _ in range(processes):
            frame, files, _, _ = socket.recv_fds(self._socket, MAX_MESSAGE, 1)
            while len(frame) > len(FORKED):  # of a process that ended meanwhile
                self._take_report(frame)
                frame, files, _, _ = socket.recv_fds(self._socket, MAX_MESSAGE, 1)
            if not files:  # the system drops what this process has no room for
                limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
                expected = f"expected fewer than {processes} processes, or a limit above {limit} open files (ulimit -n)"
                raise BadInput("--processes", "", expected)
            sockets.append(socket.socket(fileno=files[0]))
        return sockets

    def reports(self) -> list[int]:
        """The processes that have ended since the last call, also if `end` has returned how; does not wait."""
        while self._receive_report(socket.MSG_DONTWAIT):
            pass
        reports, self._reports = self._reports, []
        return reports

    def _receive_report(self, flags: int = 0) -> bool:
        """Receive a report; False if there is none, now or, since the server has ended, at all."""
        try:
            frame = self._socket.recv(MAX_MESSAGE, flags)
        except BlockingIOError:
            return False
        if not frame:
            self.is_gone = True
            return False
        self._take_report(frame)
        return True

    def _take_report(self, frame: bytes) -> None:
        process, how = content(frame)
        self._ended[process] = how
        self._reports.append(process)

    def end(self, process: int, *, closed: bool = False) -> str:
        """Kill a process; returns how it ended: by itself, if it had ended before.

        With `closed` its socket is at its end, as if it ended by itself, for which the server waits a moment.
        """
        with suppress(OSError):  # the server is gone
            if process not in self._ended:
                send(self._socket, (message(KILL, (process, closed)),))
            while process not in self._ended and self._receive_report():
                pass
        return self._ended.get(process, "ended with its fork server")

    def close(self) -> None:
        """End the server and all its processes."""
        self._socket.close()
        os.waitpid(self.pid, 0)


def _serve_isolated(control: socket.socket, isolation: Isolation) -> None:
    """Enter the borders that all processes share, report how that went, and serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the host
    try:
        missing = isolation.enter_server()
    except IsolationFailed as error:
        send(control, (message(ENTERED, (str(error), list[str]())),))
        return
    send(control, (message(ENTERED, ("", missing)),))
    _Server(control, isolation).serve()


class _Server:
    """The fork server: it carries out the host's requests until that is gone, then kills all processes."""

    def __init__(self, control: socket.socket, isolation: Isolation) -> None:
        self._control, self._isolation = control, isolation
        self._processes: dict[int, int] = {}  # number by process id, of those that live
        self._pids: list[int] = []
        self._own = os.pidfd_open(os.getpid())
        self._wake, wakes = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(wakes, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda _number, _frame: None)
        self._files = (self._own, self._wake, wakes)
        self._has_orphans = False  # whether there may be any
        adopt_orphans()

    def serve(self) -> None:
        """Serve until the host closes its end."""
        waits = select.poll()
        for file in (self._control.fileno(), self._wake):
            waits.register(file, select.POLLIN)
        try:
            while True:
                readable = {file for file, _ in waits.poll(0 if self._has_orphans else None)}
                if not readable:  # one look at all processes of the machine for many that ended
                    self._end_orphans()
                if self._wake in readable:
                    os.read(self._wake, 4096)
                    self._report()
                if self._control.fileno() in readable:
                    try:
                        frame = receive(self._control)
                    except ConnectionResetError:  # the host ended with reports that it did not read
                        return
                    if not frame:
                        return
                    self._carry_out(frame_kind(frame), content(frame))
        finally:
            for pid in self._processes:
                os.kill(pid, signal.SIGKILL)
            for pid in self._processes:
                os.waitpid(pid, 0)
            self._processes.clear()
            self._end_orphans()

    def _carry_out(self, kind: int, request: Any) -> None:
        if kind == LOAD and self._isolation.shares_code:
            for agent in request:
                with suppress(NoAgent):
                    load_agent(agent)
        elif kind == FORK:
            gc.collect()
            gc.freeze()  # the collector would write to, and so copy, every shared page
            for _ in range(request):
                self._fork()
        elif kind == KILL:
            process, closed = cast("tuple[int, bool]", request)
            pid = self._pids[process]
            if pid in self._processes:
                self._end(pid, closed=closed)

    def _fork(self) -> None:
        of_host, of_process = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        pid = self._isolation.fork(self._own)
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._control.close()
            of_host.close()
            end_with_parent(self._own)
            for file in self._files[1:]:
                os.close(file)
            _exit_after(lambda: _play(of_process, self._isolation))
        of_process.close()
        self._processes[pid] = len(self._pids)
        self._pids.append(pid)
        socket.send_fds(self._control, [FORKED], [of_host.fileno()])
        of_host.close()

    def _end(self, pid: int, *, closed: bool) -> None:
        """End a process, and report it."""
        ends = select.poll()
        file = os.pidfd_open(pid)
        ends.register(file, select.POLLIN)
        by_itself = ends.poll(CLOSES_MS if closed else 0)  # the system closes the socket of one that ends a bit before
        os.close(file)
        if not by_itself:
            os.kill(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        self._ended(pid, CLOSED if closed and not by_itself else _in_words(status))

    def _report(self) -> None:
        """Report the processes that have ended; their orphans, which are this process's children now, are no such."""
        with suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                pid, status = ended
                if pid in self._processes:
                    self._ended(pid, _in_words(status))

    def _ended(self, pid: int, how: str) -> None:
        process = self._processes.pop(pid)
        self._has_orphans = True
        with suppress(OSError):  # the host is gone: `serve` finds the end of its socket
            send(self._control, (message(ENDED, (process, how)),))

    def _end_orphans(self) -> None:
        """End the programs that processes started and left behind: the system made them this process's children."""
        self._has_orphans = False
        for _ in range(ORPHAN_ROUNDS):
            orphans = [pid for pid in _children() if pid not in self._processes]
            if not orphans:
                return
            for pid in orphans:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            for pid in orphans:
                with suppress(ChildProcessError):
                    os.waitpid(pid, 0)


def _children() -> list[int]:
    """The children of this process, from /proc; none where /proc is of another process namespace."""
    children: list[int] = []
    parent = os.getpid()
    if Path("/proc/self").readlink().name != str(parent):
        return children
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            with suppress(OSError):
                _, _, fields = (folder / "stat").read_text().rpartition(")")
                if int(fields.split()[1]) == parent:
                    children.append(int(folder.name))
    return children


def _play(sock: socket.socket, isolation: Isolation) -> None:
    isolation.enter_process()
    serve(sock)


def _in_words(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    return f"ended with exit code {code}" if code >= 0 else f"was ended by {signal.Signals(-code).name}"


def _exit_after(work: Callable[[], None]) -> NoReturn:
    code = 1
    try:
        work()
        code = 0
    except BaseException:  # noqa: BLE001 - the last frame of this process: show any error and end
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


if __name__ == "__main__":  # whether this system allows an isolation, as an exit code, and what is missing
    try:
        server = ForkServer(Isolation.in_arguments(sys.argv[1:]))
        sys.stdout.write("".join(f"{border}\n" for border in server.missing))
        server.close()
    except BadInput as fault:
        sys.exit(fault.expected)
