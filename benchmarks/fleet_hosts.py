"""Hosts of a fleet for benchmarks, in a process of their own: `python -m benchmarks.fleet_hosts KIND COUNT FOLDER`.

It prints where they listen and with which keys, and serves until its standard input ends. Each has a home of its own,
a bare Python and stand-ins for systemd, as in the tests.
"""

import json
import sys
from contextlib import ExitStack
from pathlib import Path

import asyncssh

from tests.support.deploy.fleet.hosts import FakeHost, HostServers, host_servers, openssh


def main() -> None:
    """Serve."""
    kind, count, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    client_key = asyncssh.read_private_key(str(folder / "id"))
    with ExitStack() as stack:
        servers = stack.enter_context(host_servers(client_key))
        hosts = [_host(kind, folder / f"home-{index}", servers, client_key, stack) for index in range(count)]
        print(json.dumps([[host.port, host.host_key.export_public_key().decode()] for host in hosts]), flush=True)
        sys.stdin.read()


def _host(kind: str, home: Path, servers: HostServers, client_key: asyncssh.SSHKey, stack: ExitStack) -> FakeHost:
    return servers.add(home) if kind == "asyncssh" else stack.enter_context(openssh(home, client_key))


if __name__ == "__main__":
    main()
