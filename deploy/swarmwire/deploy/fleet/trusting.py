"""Keys of hosts that are met for the first time: shown, and kept."""

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import asyncssh

from swarmwire.deploy.fleet.connecting import CONNECT_S, is_known, keys_in
from swarmwire.deploy.fleet.fleet import Host
from swarmwire.metrics.atomic import output_file


@dataclass(frozen=True)
class NewHost:
    """A host and the key that it showed; without a key it was out of reach."""

    host: Host
    fingerprint: str = ""
    line: str = ""  # of a known_hosts file


async def trust_new(hosts: Iterable[Host], known_hosts: Path) -> list[NewHost]:
    """Add the keys of hosts that are not in the file yet; those of others stay, whatever they show now."""
    known = keys_in(known_hosts)
    found = await asyncio.gather(*(_asked(host) for host in _once(hosts) if not is_known(host, known)))
    lines = [new.line for new in found if new.line]
    if lines:
        _append(known_hosts, lines)
    return found


def _once(hosts: Iterable[Host]) -> list[Host]:
    return list({(host.address, host.port): host for host in hosts}.values())


async def _asked(host: Host) -> NewHost:
    try:
        async with asyncio.timeout(CONNECT_S):
            key = await asyncssh.get_server_host_key(host.address, host.port)
    except (OSError, asyncssh.Error, TimeoutError):
        return NewHost(host)
    if key is None:
        return NewHost(host)
    name = host.address if host.port == 22 else f"[{host.address}]:{host.port}"
    exported = key.export_public_key("openssh").decode().split()
    return NewHost(host, f"{key.get_algorithm()} {key.get_fingerprint()}", f"{name} {exported[0]} {exported[1]}")


def _append(file: Path, lines: Sequence[str]) -> None:
    with output_file(file) as aside:
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        whole = text + ("\n" if text and not text.endswith("\n") else "") + "\n".join(lines) + "\n"
        aside.write_text(whole, encoding="utf-8")
