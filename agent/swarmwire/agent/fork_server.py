"""The server that forks agent processes, reports their ends, and ends programs that they leave behind.

The host forks it before it opens a network session, so the server has no threads; it imports the agents' code once,
for all processes. A process gets one socket to its host, and its robots only through that. It ends with its host and
with the fork server, for any agent; so do the programs that it started.
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
from swarmwire.agent.process_frames import MAX_MESSAGE, content_frame, frame_content, frame_kind, receive, send
from swarmwire.comms.base.errors import BadInput

LOAD, FORK, KILL, ENDED, ENTERED = range(5)  # frames: three to the fork server, two to the host
FORKED = b"s"  # message that carries the socket to a process
EXIT_TIMEOUT_MS = 200  # a process that has closed its socket may take this long to end
CLOSED = "closed its socket"
ORPHAN_ROUNDS = 50  # attempts to end the programs of a process, which may start more


class ForkServer:
    """The host's side of the fork server.

    Attributes:
        missing: borders of the processes that this system does not allow, a line each.
        is_gone: True once the server has ended, and all processes with it.
    """

    def __init__(self, isolation: Isolation = DEFAULT_ISOLATION) -> None:
        """Fork the server from this process, which must have one thread; BadInput if the isolation is impossible."""
        self._socket, server_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._endings: dict[int, str] = {}  # how each process ended, in words
        self._reports: list[int] = []
        self.is_gone = False
        host = os.pidfd_open(os.getpid())
        self.pid = os.fork()
        if self.pid == 0:
            self._socket.close()
            end_with_parent(host)
            _exit_after(lambda: _serve_isolated(server_socket, isolation))
        os.close(host)
        server_socket.close()
        self.missing: list[str] = []
        entered = receive(self._socket)
        if not entered or frame_kind(entered) != ENTERED:
            raise BadInput("--isolate", "", "expected a fork server, which ended")
        fault, self.missing = frame_content(entered)
        if fault:
            self.close()
            raise BadInput("--isolate", "", fault)

    def fileno(self) -> int:
        """Return the file that is readable once processes have ended."""
        return self._socket.fileno()

    def load(self, agents: Sequence[str]) -> None:
        """Import agents, whose processes then share the code; a missing agent fails in its process."""
        send(self._socket, (content_frame(LOAD, list(agents)),))

    def fork(self, processes: int) -> list[socket.socket]:
        """Fork processes, numbered from 0 and on; return the sockets to them, whose first frame is `assign`.

        BadInput if this process may not open so many files; OSError if the server is gone.
        """
        send(self._socket, (content_frame(FORK, processes),))
        sockets: list[socket.socket] = []
        for _ in range(processes):
            frame, files, _, _ = socket.recv_fds(self._socket, MAX_MESSAGE, 1)
            while len(frame) > len(FORKED):  # report of a process that ended meanwhile
                self._store_report(frame)
                frame, files, _, _ = socket.recv_fds(self._socket, MAX_MESSAGE, 1)
            if not files:  # the system drops files above the limit of this process
                limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
                expected = f"expected fewer than {processes} processes, or a limit above {limit} open files (ulimit -n)"
                raise BadInput("--processes", "", expected)
            sockets.append(socket.socket(fileno=files[0]))
        return sockets

    def reports(self) -> list[int]:
        """Return the processes that have ended since the last call, also those of `end`; do not wait."""
        while self._receive_report(socket.MSG_DONTWAIT):
            pass
        reports, self._reports = self._reports, []
        return reports

    def _receive_report(self, flags: int = 0) -> bool:
        """Receive a report; return False if there is none now, or if the server has ended."""
        try:
            frame = self._socket.recv(MAX_MESSAGE, flags)
        except BlockingIOError:
            return False
        if not frame:
            self.is_gone = True
            return False
        self._store_report(frame)
        return True

    def _store_report(self, frame: bytes) -> None:
        process, ending = frame_content(frame)
        self._endings[process] = ending
        self._reports.append(process)

    def end(self, process: int, *, closed: bool = False) -> str:
        """Kill a process; return how it ended, also if it had ended before.

        `closed`: its socket is closed, so that it probably ends by itself; the server waits a moment for that.
        """
        with suppress(OSError):  # the server is gone
            if process not in self._endings:
                send(self._socket, (content_frame(KILL, (process, closed)),))
            while process not in self._endings and self._receive_report():
                pass
        return self._endings.get(process, "ended with its fork server")

    def close(self) -> None:
        """End the server and all its processes."""
        self._socket.close()
        os.waitpid(self.pid, 0)


def _serve_isolated(control: socket.socket, isolation: Isolation) -> None:
    """Enter the borders that all processes share, report the result, and serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the host
    try:
        missing = isolation.enter_server()
    except IsolationFailed as error:
        send(control, (content_frame(ENTERED, (str(error), list[str]())),))
        return
    send(control, (content_frame(ENTERED, ("", missing)),))
    _Server(control, isolation).serve()


class _Server:
    """The fork server: it carries out the host's requests until the host is gone, then kills all processes."""

    def __init__(self, control: socket.socket, isolation: Isolation) -> None:
        self._control, self._isolation = control, isolation
        self._processes: dict[int, int] = {}  # numbers of live processes, by process id
        self._pids: list[int] = []
        self._server = os.pidfd_open(os.getpid())
        self._wake, wake_input = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(wake_input, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda _number, _frame: None)
        self._files = (self._server, self._wake, wake_input)
        self._has_orphans = False  # True: there may be orphans
        adopt_orphans()

    def serve(self) -> None:
        """Serve until the host closes its end."""
        poll = select.poll()
        for file in (self._control.fileno(), self._wake):
            poll.register(file, select.POLLIN)
        try:
            while True:
                readable = {file for file, _ in poll.poll(0 if self._has_orphans else None)}
                if not readable:  # one search through the machine's processes for many that ended
                    self._end_orphans()
                if self._wake in readable:
                    os.read(self._wake, 4096)
                    self._report_ends()
                if self._control.fileno() in readable:
                    try:
                        frame = receive(self._control)
                    except ConnectionResetError:  # the host ended with reports that it did not read
                        return
                    if not frame:
                        return
                    self._carry_out(frame_kind(frame), frame_content(frame))
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
        host_socket, process_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        pid = self._isolation.fork(self._server)
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._control.close()
            host_socket.close()
            end_with_parent(self._server)
            for file in self._files[1:]:
                os.close(file)
            _exit_after(lambda: _run_process(process_socket, self._isolation))
        process_socket.close()
        self._processes[pid] = len(self._pids)
        self._pids.append(pid)
        socket.send_fds(self._control, [FORKED], [host_socket.fileno()])
        host_socket.close()

    def _end(self, pid: int, *, closed: bool) -> None:
        """End a process, and report it."""
        ends = select.poll()
        file = os.pidfd_open(pid)
        ends.register(file, select.POLLIN)
        # The system closes the socket of a process shortly before its end.
        ended_itself = ends.poll(EXIT_TIMEOUT_MS if closed else 0)
        os.close(file)
        if not ended_itself:
            os.kill(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        self._report_end(pid, CLOSED if closed and not ended_itself else _exit_text(status))

    def _report_ends(self) -> None:
        """Report the processes that have ended, but not their orphans, which are children of this process now."""
        with suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                pid, status = ended
                if pid in self._processes:
                    self._report_end(pid, _exit_text(status))

    def _report_end(self, pid: int, ending: str) -> None:
        process = self._processes.pop(pid)
        self._has_orphans = True
        with suppress(OSError):  # the host is gone: `serve` finds the end of its socket
            send(self._control, (content_frame(ENDED, (process, ending)),))

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
    """Return the children of this process from /proc; none if /proc is that of another process namespace."""
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


def _run_process(sock: socket.socket, isolation: Isolation) -> None:
    isolation.enter_process()
    serve(sock)


def _exit_text(status: int) -> str:
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


if __name__ == "__main__":  # prints the borders that this system does not allow; exit code 0 if it allows the isolation
    try:
        server = ForkServer(Isolation.in_arguments(sys.argv[1:]))
        sys.stdout.write("".join(f"{border}\n" for border in server.missing))
        server.close()
    except BadInput as fault:
        sys.exit(fault.expected)
