"""Packages of robots are made once, from wheels for their platform."""

import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from swarmwire.deploy.fleet.packages import LockedEnvironments, Target, pins
from swarmwire.deploy.fleet.release import Archive
from swarmwire.deploy.fleet.result import HostFailed

PI = {
    "system": "Linux", "implementation": "cpython", "libc": ["glibc", "2.36"], "machine": "aarch64", "bits": 64,
    "python": [3, 11, 2],
}  # fmt: skip
TARGET = Target.of(PI)
OF_PI = "cp39-abi3-manylinux_2_28_aarch64"


def wheel(folder: Path, name: str, version: str, tag: str, **files: str) -> None:
    """A wheel of a few small files."""
    underscored = name.replace("-", "_")
    about = f"{underscored}-{version}.dist-info"
    with zipfile.ZipFile(folder / f"{underscored}-{version}-{tag}.whl", "w") as archive:
        for path, text in files.items():
            archive.writestr(path, text)
        archive.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        archive.writestr(f"{about}/WHEEL", f"Wheel-Version: 1.0\nTag: {tag}\n")
        archive.writestr(f"{about}/RECORD", "")


@pytest.fixture
def wheels(tmp_path) -> Path:
    """Tiny wheels of all that a robot with an e-puck2 needs, for a Raspberry Pi."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    for pin in pins(["epuck2"], [], TARGET.python):
        files = {
            f"{pin.name}_small.py": "x = 1", f"{pin.name}_small.pyi": "x: int", "numpy/tests/test_it.py": "",
            f"{pin.name}-{pin.version}.data/purelib/of_data_{pin.name.replace('-', '_')}.py": "",
            f"{pin.name}-{pin.version}.data/scripts/tool": "",
        }  # fmt: skip
        wheel(folder, pin.name, pin.version, OF_PI, **files)
    return folder


def made(tmp_path: Path, wheels: Path) -> list[Archive]:
    """The packages of a robot with an e-puck2, from these wheels alone."""
    index = ("--no-index", "--find-links", str(wheels))
    return LockedEnvironments(tmp_path / "cache", index).archives(TARGET, ["epuck2"], [])


def names(archive: Archive) -> set[str]:
    with tarfile.open(archive.path) as tar:
        return set(tar.getnames())


def test_wheels_for_the_robot_are_unpacked_without_what_it_has_no_use_for(tmp_path, wheels):
    own, others = made(tmp_path, wheels)
    assert {"swarmwire/agent/cli.py", "swarmwire/comms/clock.py"} <= names(own)
    assert any(
        name.endswith(f"swarmwire_agent-{version('swarmwire-agent')}.dist-info/entry_points.txt") for name in names(own)
    )
    assert not any("__pycache__" in name for name in names(own))
    packed = names(others)
    assert {"numpy_small.py", "msgpack_small.py", "of_data_eclipse_zenoh.py"} <= packed
    assert not any(name.endswith((".pyi", "tool")) or "/tests/" in name for name in packed)


def test_what_was_made_is_kept_and_needs_no_index_again(tmp_path, wheels):
    first = made(tmp_path, wheels)
    for path in wheels.iterdir():
        path.unlink()
    assert made(tmp_path, wheels) == first


def test_a_robot_for_which_there_is_no_wheel_is_told(tmp_path, wheels):
    next(wheels.glob("numpy*")).unlink()
    with pytest.raises(HostFailed, match=r"numpy==[\d.]+ for cp311-aarch64-glibc2\.36"):
        made(tmp_path, wheels)
    assert not list((tmp_path / "cache").glob("*.part"))


@pytest.mark.slow
@pytest.mark.parametrize(("python", "glibc"), [((3, 11), (2, 36)), ((3, 13), (2, 41))])
@pytest.mark.parametrize("driver", ["epuck2", "ros2"])
def test_the_index_has_wheels_for_a_raspberry_pi(tmp_path, python, glibc, driver):
    target = Target(python, "aarch64", glibc)
    _, others = LockedEnvironments(tmp_path).archives(target, [driver], [])
    assert any(name.endswith("zenoh.abi3.so") for name in names(others))


@pytest.mark.slow
def test_what_is_made_for_this_machine_runs_an_agents_program_here(tmp_path):
    import platform

    libc = platform.libc_ver()[1].split(".")
    target = Target(sys.version_info[:2], platform.machine(), (int(libc[0]), int(libc[1])))
    paths = []
    for place, archive in enumerate(LockedEnvironments(tmp_path).archives(target, ["epuck2"], [])):
        paths.append(str(tmp_path / str(place)))
        with tarfile.open(archive.path) as tar:
            tar.extractall(paths[-1], filter="data")
    bare = getattr(sys, "_base_executable", sys.executable)  # of which this project's packages are no part
    done = subprocess.run(
        [bare, "-P", "-m", "swarmwire.agent.cli", "drivers"],
        env={"PYTHONPATH": ":".join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "epuck2" in done.stdout, done.stderr
