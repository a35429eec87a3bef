"""Runners of the benchmark `tls-cost`: one process that forks them, each with a certificate of its own, or none."""

import os
import sys
from pathlib import Path

from swarmwire.agent import runner
from swarmwire.agent.agent import load_agent
from swarmwire.agent.fork_server import ForkServer
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import closed_after, open_runner


def main(endpoint: str, run_id: str, agent: str, certs: str, *names: str) -> None:
    """Play with these names; `certs` is the folder of their certificates, or empty."""
    load_agent(agent)
    children: list[int] = []
    for name in names:
        child = os.fork()
        if not child:
            server = ForkServer()
            _play(server, endpoint, run_id, name, _network(Path(certs), name) if certs else None)
            os._exit(0)
        children.append(child)
    for child in children:
        os.waitpid(child, 0)


def _play(server: ForkServer, endpoint: str, run_id: str, name: str, network: Network | None) -> None:
    with closed_after(open_runner(endpoint, 30.0, network)) as session:
        runner.run_in_session(
            session, Keys(run_id), name, runner.Arrivals(), lambda: runner.NEXT_FREE, runner.ProcessPool(server)
        )


def _network(certs: Path, name: str) -> Network:
    return Network(ca=certs / "ca.pem", certificate=certs / f"{name}.pem", key=certs / f"{name}.key")


if __name__ == "__main__":
    main(*sys.argv[1:])
