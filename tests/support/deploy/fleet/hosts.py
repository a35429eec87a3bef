"""Hosts with an SSH server: our own, and OpenSSH."""

import asyncio
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import asyncssh
import pytest

STAND_INS = Path(__file__).parent / "stand_ins"
PYTHON = str(Path(getattr(sys, "_base_executable", sys.executable)).resolve())  # without this project's packages
TIMEOUT_S = 20
SSHD = shutil.which("sshd", path="/usr/sbin:/usr/local/sbin:/usr/bin")
CONFIG = """\
ListenAddress 127.0.0.1
Port {port}
HostKey {folder}/host_key
PidFile none
AuthorizedKeysFile {folder}/authorized
StrictModes no
PasswordAuthentication no
KbdInteractiveAuthentication no
PermitRootLogin yes
SetEnv {environment}
LogLevel ERROR
"""


def new_key() -> asyncssh.SSHKey:
    """A key of a user or a host."""
    return asyncssh.generate_private_key("ssh-ed25519")


def write_key(key: asyncssh.SSHKey, path: Path) -> None:
    """Write a user's key, for its owner alone."""
    key.write_private_key(str(path))
    path.chmod(0o600)


@dataclass
class FakeHost:
    """One host, its faults, and its files."""

    home: Path
    port: int = 0
    host_key: asyncssh.SSHKey = field(default_factory=new_key)
    cut_after: int | None = None  # bytes that it reads of a command's input before the connection breaks
    before_cut: Callable[[], None] | None = None
    python: str = f'exec {PYTHON} "$@"'  # the script that is its python3
    commands: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        shutil.copytree(STAND_INS, self.bin)
        self.set_python(self.python)

    @property
    def bin(self) -> Path:
        return self.home / "bin"

    @property
    def root(self) -> Path:
        return self.home / "swarmwire"

    @property
    def environment(self) -> dict[str, str]:
        path = f"{self.bin}:/usr/bin:/bin"
        return {"HOME": str(self.home), "PATH": path, "LANG": "C.UTF-8", "XDG_RUNTIME_DIR": str(self.home / ".run")}

    def set_program(self, name: str, script: str) -> None:
        """Replace a program of the host by a script."""
        (self.bin / name).write_text(f"#!/bin/sh\n{script}\n")
        (self.bin / name).chmod(0o755)

    def set_python(self, script: str) -> None:
        """Replace the host's `python3`."""
        self.set_program("python3", script)

    def files(self) -> set[str]:
        """All files and links below ~/swarmwire."""
        paths = (path for path in self.root.rglob("*") if path.is_symlink() or path.is_file())
        return {str(path.relative_to(self.root)) for path in paths}

    def current(self, robot: str) -> str | None:
        link = self.root / robot / "current"
        return link.readlink().name if link.is_symlink() else None

    def releases(self, robot: str) -> list[str]:
        return sorted(path.name for path in self.root.glob(f"{robot}/releases/*"))

    def environments(self) -> list[str]:
        return sorted(path.name for path in self.root.glob("env/*"))

    def parts(self) -> list[str]:
        """Return incomplete files and folders."""
        return sorted(path.name for path in self.root.rglob("*.part"))

    def end_units(self) -> None:
        """Whatever a test has started ends with it."""
        for file in (self.home / ".units").glob("*.service"):
            for end in (os.killpg, os.kill):  # it leads a group, unless it had no time to begin one
                with suppress(ProcessLookupError, ValueError):
                    end(int(file.read_text()), signal.SIGKILL)


class HostServers:
    """The servers of fake hosts, all in one thread."""

    def __init__(self, client_key: asyncssh.SSHKey) -> None:
        self._client_key = client_key
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()
        self.hosts: list[FakeHost] = []
        self._open: list[asyncssh.SSHAcceptor] = []
        self._silent: list[asyncio.Server] = []

    def add(self, home: Path) -> FakeHost:
        """One more host, which can be reached at `127.0.0.1:<port>`."""
        host = FakeHost(home)
        self.hosts.append(host)
        self._run(self._listen(host))
        return host

    def add_port(self) -> int:
        """A port at which something answers, though it says nothing."""

        async def listen() -> asyncio.Server:
            return await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)

        self._silent.append(self._run(listen()))
        return self._silent[-1].sockets[0].getsockname()[1]

    def change_key(self, host: FakeHost) -> None:
        """The host is another machine, or was set up anew."""
        host.host_key = new_key()
        self._acceptor(host).update(server_host_keys=[host.host_key])

    def close(self, host: FakeHost) -> None:
        """Switch a host off."""
        self._loop.call_soon_threadsafe(self._acceptor(host).close)

    def end(self) -> None:
        """Close all, with what runs on them."""
        for host in self.hosts:
            host.end_units()
        self._run(self._close_all())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(TIMEOUT_S)
        self._loop.close()

    def _acceptor(self, host: FakeHost) -> asyncssh.SSHAcceptor:
        return next(acceptor for acceptor in self._open if acceptor.get_port() == host.port)

    def _run(self, coroutine: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(TIMEOUT_S)

    async def _listen(self, host: FakeHost) -> None:
        authorized = asyncssh.import_authorized_keys(self._client_key.export_public_key().decode())
        keys = {"server_host_keys": [host.host_key], "authorized_client_keys": authorized}
        options = {"process_factory": lambda process: _serve(host, process), "encoding": None}
        acceptor = await asyncssh.listen("127.0.0.1", 0, agent_forwarding=False, **keys, **options)
        host.port = acceptor.get_port()
        self._open.append(acceptor)

    async def _close_all(self) -> None:
        for listener in (*self._open, *self._silent):
            listener.close()
            await listener.wait_closed()
        current = asyncio.current_task()
        others = [task for task in asyncio.all_tasks() if task is not current]
        if others:
            await asyncio.wait(others, timeout=TIMEOUT_S / 4)
        await self._loop.shutdown_asyncgens()
        await self._loop.shutdown_default_executor()


async def _serve(host: FakeHost, process: "asyncssh.SSHServerProcess[bytes]") -> None:
    """A command in a real shell, in the host's home."""
    host.commands.append(process.command or "")
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), asyncio.subprocess.PIPE)
    command = ("/bin/sh", "-c", process.command or "true")
    shell: Any = await asyncio.create_subprocess_exec(*command, cwd=host.home, env=host.environment, **pipes)
    feeding = asyncio.create_task(_feed(host, process, shell.stdin))
    await asyncio.gather(_print(shell.stdout, process.stdout), _print(shell.stderr, process.stderr))
    status = await shell.wait()
    feeding.cancel()
    with suppress(asyncio.CancelledError):
        await feeding
    with suppress(OSError, asyncssh.Error):
        process.exit(status)


async def _print(output: asyncio.StreamReader, to: "asyncssh.SSHWriter[bytes]") -> None:
    """Forward a command's output, also after the client is gone."""
    while block := await output.read(1 << 16):
        with suppress(OSError, asyncssh.Error):
            to.write(block)
            await to.drain()


async def _feed(host: FakeHost, process: "asyncssh.SSHServerProcess[bytes]", to: asyncio.StreamWriter) -> None:
    """Forward the client's input up to the limit."""
    remaining = host.cut_after
    with suppress(OSError, asyncssh.Error):
        while block := await process.stdin.read(1 << 16):
            if remaining is not None and (remaining := remaining - len(block)) < 0:
                if host.before_cut:
                    host.before_cut()
                process.channel.get_connection().abort()
                break
            to.write(block)
            await to.drain()
    to.close()


@contextmanager
def host_servers(client_key: asyncssh.SSHKey) -> Generator[HostServers]:
    servers = HostServers(client_key)
    try:
        yield servers
    finally:
        servers.end()


def need_sshd() -> str:
    """OpenSSH's server; the test is skipped where there is none that can be started."""
    if SSHD is None:
        pytest.skip("there is no sshd: apt install openssh-server")
    return SSHD


@contextmanager
def openssh(home: Path, client_key: asyncssh.SSHKey) -> Generator[FakeHost]:
    """A host that OpenSSH serves; it is told by its first answer that it listens."""
    program, host = need_sshd(), FakeHost(home)
    folder = home / ".sshd"
    folder.mkdir()
    host.host_key.write_private_key(str(folder / "host_key"))
    (folder / "host_key").chmod(0o600)
    client_key.write_public_key(str(folder / "authorized"))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        host.port = free.getsockname()[1]
    environment = " ".join(f"{name}={value}" for name, value in host.environment.items())
    config = CONFIG.format(port=host.port, folder=folder, environment=environment)
    (folder / "config").write_text(config)
    command = [*_wrapped(), program, "-D", "-e", "-f", str(folder / "config")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        _wait(host.port, process)
        yield host
    finally:
        process.terminate()
        process.wait(10)
        process.stderr.close()
        host.end_units()


def _wrapped() -> list[str]:
    """Return the prefix of sshd's command: root's sshd needs /run/sshd, which only this process sees."""
    if os.getuid() or Path("/run/sshd").exists():
        return []
    return ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /run && mkdir /run/sshd && exec "$0" "$@"']


def _wait(port: int, process: "subprocess.Popen[str]") -> None:
    """Until it listens; the test is skipped if it cannot, as without a folder for its privileges."""
    while process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 1.0).close()
        except ConnectionRefusedError:
            continue
        return
    pytest.skip(f"sshd does not start: {process.stderr.read().strip()}")
