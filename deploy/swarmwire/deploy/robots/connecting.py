"""SSH connections to hosts, with a key of the user, to hosts whose host key is in a `known_hosts` file.

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

CONNECT_TIMEOUT_S = 10.0
KEEPALIVE_INTERVAL_S, MAX_KEEPALIVES = 5, 3  # a host that leaves so many keepalives unanswered is lost


@asynccontextmanager
async def connected(
    host: Host, known_hosts: Path, timeout_s: float = CONNECT_TIMEOUT_S
) -> AsyncGenerator[asyncssh.SSHClientConnection]:
    """Connect to the host for the block; HostFailed with cause and remedy if that fails or the connection is lost."""
    host_keys = keys_in(known_hosts)
    _check_known(host, host_keys, known_hosts)
    try:
        connection = await _connect(host, host_keys, timeout_s)
    except asyncssh.PermissionDenied:
        copy = f"ssh-copy-id -p {host.port} {host.user}@{host.address}"
        raise HostFailed(f"{host} lets no key of ours in", copy) from None
    except (asyncssh.HostKeyNotVerifiable, asyncssh.KeyExchangeFailed) as error:
        raise _changed(host, known_hosts, str(error)) from None
    except (asyncssh.KeyImportError, asyncssh.KeyEncryptionError) as error:
        raise HostFailed(f"the key {host.key} cannot be used: {error}", "ssh-add it, and leave key out") from None
    except (OSError, asyncssh.Error, TimeoutError) as error:
        raise HostFailed(
            f"{host} cannot be reached: {_reason(error)}", "is it switched on, and its address right?"
        ) from None
    try:
        async with connection:
            yield connection
    except (asyncssh.Error, BrokenPipeError, ConnectionError) as error:
        raise lost(_reason(error)) from None


def lost(reason: str = "") -> HostFailed:
    """Return the failure of a lost connection."""
    cause = "the connection was lost" + (f": {reason}" if reason else "")
    return HostFailed(cause, "do it again: the interrupted step has changed nothing")


def keys_in(known_hosts: Path) -> asyncssh.SSHKnownHosts:
    """Read the keys of a `known_hosts` file, none if it does not exist; BadInput if it cannot be read."""
    if not known_hosts.exists():
        return asyncssh.import_known_hosts("")
    try:
        return asyncssh.read_known_hosts(str(known_hosts))
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise BadInput(str(known_hosts), "", f"expected keys of hosts as OpenSSH keeps them: {error}") from None


def is_known(host: Host, host_keys: asyncssh.SSHKnownHosts) -> bool:
    """Return True if there is a key, or an authority, for the host."""
    keys, authorities, *_ = host_keys.match(host.address, "", None if host.port == 22 else host.port)
    return bool(keys or authorities)


async def _connect(host: Host, host_keys: asyncssh.SSHKnownHosts, timeout_s: float) -> asyncssh.SSHClientConnection:
    options = {"client_keys": [host.key]} if host.key else {}
    async with asyncio.timeout(timeout_s):
        return await asyncssh.connect(
            host.address,
            host.port,
            username=host.user,
            known_hosts=host_keys,
            keepalive_interval=KEEPALIVE_INTERVAL_S,
            keepalive_count_max=MAX_KEEPALIVES,
            password=None,
            **options,
        )


def _check_known(host: Host, host_keys: asyncssh.SSHKnownHosts, file: Path) -> None:
    if not is_known(host, host_keys):
        raise HostFailed(f"the key of {host} is not in {file}", "swarmwire robots check --trust shows and adds it")


def _changed(host: Host, file: Path, detail: str) -> HostFailed:
    return HostFailed(
        f"{host} is another machine or was reinstalled: its key is not the one in {file} ({detail})",
        "if that is as it should be, remove its line there, then swarmwire robots check --trust",
    )


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    if isinstance(error, asyncssh.Error):
        return error.reason
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


@dataclass(frozen=True)
class NewHost:
    """A host and its key; a host without a key did not answer."""

    host: Host
    fingerprint: str = ""
    line: str = ""  # line for a known_hosts file


async def trust_new(hosts: Iterable[Host], known_hosts: Path) -> list[NewHost]:
    """Add the keys of hosts that are not in the file yet; keys of known hosts never change."""
    host_keys = keys_in(known_hosts)
    unknown = (host for host in _distinct(hosts) if not is_known(host, host_keys))
    new_hosts = await asyncio.gather(*map(_read_key, unknown))
    lines = [new.line for new in new_hosts if new.line]
    if lines:
        _append(known_hosts, lines)
    return new_hosts


def _distinct(hosts: Iterable[Host]) -> list[Host]:
    return list({(host.address, host.port): host for host in hosts}.values())


async def _read_key(host: Host) -> NewHost:
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            key = await asyncssh.get_server_host_key(host.address, host.port)
    except (OSError, asyncssh.Error, TimeoutError):
        return NewHost(host)
    if key is None:
        return NewHost(host)
    name = host.address if host.port == 22 else f"[{host.address}]:{host.port}"
    exported = key.export_public_key("openssh").decode().split()
    return NewHost(host, f"{key.get_algorithm()} {key.get_fingerprint()}", f"{name} {exported[0]} {exported[1]}")


def _append(file: Path, lines: Sequence[str]) -> None:
    with output_file(file) as path:
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        text += ("\n" if text and not text.endswith("\n") else "") + "\n".join(lines) + "\n"
        path.write_text(text, encoding="utf-8")
