"""What a run ran on: equal hashes are promised for one CPU type with the same versions only."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("swarmwire-comms", "numpy", "numba", "pymunk", "eclipse-zenoh", "msgpack")


def cpu() -> str:
    """The CPU's model and the vector instructions that numpy uses on it."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    return f"{model} ({_simd()})"


def versions() -> dict[str, str]:
    """Python and the packages whose arithmetic a run depends on."""
    return {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}


def _simd() -> str:
    from numpy.lib import introspect

    targets = introspect.opt_func_info(func_name="^sin$", signature="float64")
    found = [target["current"] for target in targets.get("sin", {}).values() if target.get("current")]
    return found[0].split(" ")[-1] if found else "baseline"


_version = cache(version)  # reading one takes longer than a tick
