"""An agent host: a process that imports the code of runners, then forks a runner for each name on its command line.

Forking after the import makes a thousand runners cheap: they start in milliseconds and share the memory of the code.
The agent host itself never opens a zenoh session, because a session opened in the child of a process that has had one
hangs. It is a program of its own rather than multiprocessing's fork server, which would run the user's script again in
every runner.

Only some runners join at a time; the next is forked as soon as one has its robots. If a thousand joined at once, each
would wait for all others, some for longer than a query lasts.

Standard input is the life line: its end means that the world is gone, and all runners are killed. A runner that fails
is reported as one line on standard output: its name and its exit code.
"""

import gc
import os
import select
import shutil
import signal
import struct
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import zenoh

from swarmwire.agent import host, runner
from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.wire.sessions import PRIVATE

__all__ = ["host", "main"]  # the host is imported here so that its code is shared

POLL_MS = 50
AT_ONCE = 32  # runners that have no robots yet; more are forked later
PID = struct.Struct("i")  # written by a runner that has its robots


def main(arguments: list[str]) -> int:
    """`endpoint run_id agent,agent,… runner runner …`: fork the runners and wait for them all."""
    endpoint, run_id, agents, *names = arguments
    reports = os.dup(1)
    os.dup2(2, 1)  # output of agents must not reach the world that reads the reports
    for agent in agents.split(","):
        with suppress(NoAgent):  # the runner fails as well, and reports it
            load_agent(agent)
    gc.freeze()  # the collector would write to, and so copy, every shared page
    joined, tell_joined = os.pipe()

    def forked(name: str) -> int:
        child = os.fork()
        if child == 0:
            os.close(reports)
            os.close(joined)
            os._exit(_runner(endpoint, run_id, name, tell_joined))
        return child

    if not _tend(names, forked, joined, reports):
        _remove_socket(endpoint)
    return 0


def _runner(endpoint: str, run_id: str, name: str, tell_joined: int) -> int:
    os.close(0)

    def joined(_: Assignment) -> None:
        os.write(tell_joined, PID.pack(os.getpid()))
        os.close(tell_joined)

    try:
        runner.run(endpoint, run_id, name, joined)
    except (SwarmwireError, zenoh.ZError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    except BaseException:  # noqa: BLE001 - the last frame of this process: whatever it is, show it and end
        traceback.print_exc()
        return 1
    return 0


def _tend(names: Sequence[str], forked: Callable[[str], int], joined: int, reports: int) -> bool:
    """Fork a runner of each name, and whether all ended; False: the world did, and they were ended with it."""
    poll = select.poll()
    poll.register(0, select.POLLIN | select.POLLHUP)  # the life line
    poll.register(joined, select.POLLIN)
    to_fork, joining, children = list(reversed(names)), set[int](), dict[int, str]()
    while to_fork or children:
        while to_fork and len(joining) < AT_ONCE:
            name = to_fork.pop()
            child = forked(name)
            children[child] = name
            joining.add(child)
        readable = {file for file, _ in poll.poll(POLL_MS)}
        if 0 in readable:
            for child in children:
                os.kill(child, signal.SIGKILL)
            return False
        if joined in readable:
            joining.difference_update(pid for (pid,) in PID.iter_unpack(os.read(joined, AT_ONCE * PID.size)))
        child, status = os.waitpid(-1, os.WNOHANG)
        while child:
            name, code = children.pop(child), os.waitstatus_to_exitcode(status)
            joining.discard(child)
            if code != 0:
                os.write(reports, f"{name} {code}\n".encode())
            child, status = os.waitpid(-1, os.WNOHANG) if children else (0, 0)
    return True


def _remove_socket(endpoint: str) -> None:
    """Remove the private directory of the socket of a world that was killed."""
    directory = Path(endpoint.partition("/")[2]).parent
    if directory.name.startswith(PRIVATE):
        shutil.rmtree(directory, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
