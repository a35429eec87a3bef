"""The platform of a robot: for which Python, machine and C library its packages are."""

from dataclasses import dataclass
from typing import Any

from swarmwire.deploy.fleet.host_failed import HostFailed

FIRST_GLIBC = 17  # of the oldest wheels for Linux that there still are: manylinux_2_17
MACHINES = ("aarch64", "x86_64")


@dataclass(frozen=True, order=True)
class Target:
    """CPython on Linux with glibc."""

    python: tuple[int, int]
    machine: str
    glibc: tuple[int, int]

    @classmethod
    def of(cls, said: dict[str, Any]) -> "Target":
        """That of a host that says so of itself; HostFailed if there are no packages for it."""
        libc, version = said["libc"]
        if said["system"] != "Linux" or said["implementation"] != "cpython" or libc != "glibc":
            kind = f"{said['implementation']} on {said['system']} with {libc or 'another C library'}"
            raise HostFailed(f"expected CPython on Linux with glibc, got {kind}", "Raspberry Pi OS has these")
        if said["machine"] not in MACHINES or said["bits"] != 64:
            machine = f"{said['machine']} with {said['bits']} bits"
            raise HostFailed(f"expected {' or '.join(MACHINES)} with 64 bits, got {machine}", "install a 64-bit system")
        major, minor = (int(part) for part in version.split(".")[:2])
        return cls((said["python"][0], said["python"][1]), said["machine"], (major, minor))

    def __str__(self) -> str:
        """As a name of a file, and for people."""
        return f"cp{self.python[0]}{self.python[1]}-{self.machine}-glibc{self.glibc[0]}.{self.glibc[1]}"

    def pip_arguments(self) -> list[str]:
        """The options with which pip looks for wheels of this platform."""
        platforms = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc[1], FIRST_GLIBC - 1, -1)]
        platforms += [f"manylinux2014_{self.machine}", f"linux_{self.machine}"]
        version = f"{self.python[0]}.{self.python[1]}"
        options = ["--only-binary=:all:", "--no-deps", "--implementation", "cp", "--python-version", version]
        return options + [part for platform in platforms for part in ("--platform", platform)]
