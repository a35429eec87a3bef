"""SSH connections to hosts: with a key of the user's, to hosts whose own key is known.

`trust_new` adds the keys of new hosts to the `known_hosts` file.
"""

import asyncio
from collections.abc import AsyncGenerator, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import asyncssh

from swarmwire.comms.base.atomic import output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.fleet import Host
from swarmwire.deploy.robots.result import HostFailed

CONNECT_S = 10.0
ALIVE_S, ALIVE_TRIES = 5, 3  # a host that is silent for so long, so many times over, is lost


@asynccontextmanager
async def connected(
    host: Host, known_hosts: Path, connect_s: float = CONNECT_S
) -> AsyncGenerator[asyncssh.SSHClientConnection]:
    """A connection to the host; HostFailed if there is none, or once it is lost, with the cause and the cure."""
    known = keys_in(known_hosts)
    _check_known(host, known, known_hosts)
    try:
        connection = await _connect(host, known, connect_s)
    except asyncssh.PermissionDenied:
        copy = f"ssh-copy-id -p {host.port} {host.user}@{host.address}"
        raise HostFailed(f"{host} lets no key of ours in", copy) from None
    except (asyncssh.HostKeyNotVerifiable, asyncssh.KeyExchangeFailed) as error:
        raise _changed(host, known_hosts, str(error)) from None
    except (asyncssh.KeyImportError, asyncssh.KeyEncryptionError) as error:
        raise HostFailed(f"the key {host.key} cannot be used: {error}", "ssh-add it, and leave key out") from None
    except (OSError, asyncssh.Error, TimeoutError) as error:
        raise HostFailed(
            f"{host} cannot be reached: {_told(error)}", "is it switched on, and its address right?"
        ) from None
    try:
        async with connection:
            yield connection
    except (asyncssh.Error, BrokenPipeError, ConnectionError) as error:
        raise lost(_told(error)) from None


def lost(reason: str = "") -> HostFailed:
    """The failure of a connection that was there."""
    told = f": {reason}" if reason else ""
    return HostFailed(f"the connection was lost{told}", "do it again: the interrupted step has changed nothing")


def keys_in(known_hosts: Path) -> asyncssh.SSHKnownHosts:
    """The keys of a `known_hosts` file, none if there is no such file; BadInput if it cannot be read."""
    if not known_hosts.exists():
        return asyncssh.import_known_hosts("")
    try:
        return asyncssh.read_known_hosts(str(known_hosts))
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise BadInput(str(known_hosts), "", f"expected keys of hosts as OpenSSH keeps them: {error}") from None


def is_known(host: Host, known: asyncssh.SSHKnownHosts) -> bool:
    """Whether there is a key, or an authority, for the host."""
    keys, authorities, *_ = known.match(host.address, "", None if host.port == 22 else host.port)
    return bool(keys or authorities)


async def _connect(host: Host, known: asyncssh.SSHKnownHosts, connect_s: float) -> asyncssh.SSHClientConnection:
    options = {"client_keys": [host.key]} if host.key else {}
    async with asyncio.timeout(connect_s):
        return await asyncssh.connect(
            host.address,
            host.port,
            username=host.user,
            known_hosts=known,
            keepalive_interval=ALIVE_S,
            keepalive_count_max=ALIVE_TRIES,
            password=None,
            **options,
        )


def _check_known(host: Host, known: asyncssh.SSHKnownHosts, file: Path) -> None:
    if not is_known(host, known):
        raise HostFailed(f"the key of {host} is not in {file}", "swarmwire robots check --trust shows and adds it")


def _changed(host: Host, file: Path, detail: str) -> HostFailed:
    return HostFailed(
        f"{host} is another machine or was reinstalled: its key is not the one in {file} ({detail})",
        "if that is as it should be, remove its line there, then swarmwire robots check --trust",
    )


def _told(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    if isinstance(error, asyncssh.Error):
        return error.reason
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


@dataclass(frozen=True)
class NewHost:
    """A host and the key that it showed; without a key it was out of reach."""

    host: Host
    fingerprint: str = ""
    line: str = ""  # of a known_hosts file


async def trust_new(hosts: Iterable[Host], known_hosts: Path) -> list[NewHost]:
    """Add the keys of hosts that are not in the file yet; keys of known hosts never change."""
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
