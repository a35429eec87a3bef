"""OpenSSH's server as this user, on a port of its own, with a home and stand-ins like those of a fake host."""

import os
import shutil
import socket
import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import asyncssh
import pytest

from tests.support.deploy.fleet.fake_host import FakeHost

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
        assert process.stderr
        process.stderr.close()
        host.end_units()


def _wrapped() -> list[str]:
    """What root's sshd needs where it is not a service: a folder for its privileges, which this process alone sees."""
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
    assert process.stderr
    pytest.skip(f"sshd does not start: {process.stderr.read().strip()}")
