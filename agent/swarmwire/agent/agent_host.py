"""The program of an agent host on the world's machine: `python -m swarmwire.agent.agent_host`.

It forks its fork server before it opens a network session, and then is one runner with many processes.
"""

import os
import shutil
import sys
import threading
from pathlib import Path

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.isolation import Isolation, keep_from_others
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.printable import LINES, printable


def main(arguments: list[str]) -> int:
    """Run the agents that the world assigns: `endpoint run_id agent,agent,… name processes [isolation]`.

    The isolation is in the format of `Isolation.arguments`.
    """
    endpoint, run_id, agents, name, processes, *options = arguments
    try:
        server = ForkServer(Isolation.in_arguments(options))
    except BadInput as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    for border in server.missing:
        sys.stderr.write(f"agent processes: not enforced: {border}\n")
    keep_from_others()
    server.load(agents.split(","))
    _end_with_input(endpoint)
    import zenoh

    from swarmwire.agent import runner

    try:
        runner.run(endpoint, run_id, name, runner.ProcessPool(server, int(processes)))
    except (SwarmwireError, zenoh.ZError) as error:
        sys.stderr.write(f"{printable(str(error), keep=LINES)}\n")
        return 1
    finally:
        server.close()
    return 0


def _end_with_input(endpoint: str) -> None:
    """End this process and its agent processes once the standard input is closed: the world is gone."""

    def wait() -> None:
        while os.read(0, 1):
            pass
        _remove_socket(endpoint)
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()


def _remove_socket(endpoint: str) -> None:
    """Remove the private directory of the socket of a world that was killed."""
    from swarmwire.comms.wire.sessions import PRIVATE

    directory = Path(endpoint.partition("/")[2]).parent
    if directory.name.startswith(PRIVATE):
        shutil.rmtree(directory, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
