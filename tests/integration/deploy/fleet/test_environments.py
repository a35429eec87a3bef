"""Packages of robots: which, at which versions, for which platform, and that they are made once."""

import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.archive import Archive, Entry, name_of, write_archive
from swarmwire.deploy.fleet.environment.environments import LockedEnvironments
from swarmwire.deploy.fleet.environment.pins import pins
from swarmwire.deploy.fleet.environment.target import Target
from swarmwire.deploy.fleet.host_failed import HostFailed

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


def test_an_agent_needs_three_packages_beside_swarmwire_and_a_driver_its_own():
    assert [pin.name for pin in pins(["epuck2"], [], (3, 11))] == ["eclipse-zenoh", "msgpack", "numpy"]
    assert {"rosbags", "lz4", "ruamel-yaml"} <= {pin.name for pin in pins(["ros2"], [], sys.version_info[:2])}
    assert "scipy" in [pin.name for pin in pins(["epuck2"], ["scipy"], (3, 11))]
    with pytest.raises(BadInput, match="packages: not-there: is not installed here"):
        pins(["epuck2"], ["not-there"], (3, 11))


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="what older versions need is not installed here")
def test_what_only_some_versions_of_python_need_goes_to_robots_that_have_them():
    names = {python: {pin.name for pin in pins(["ros2"], [], python)} for python in ((3, 11), (3, 13), (3, 14))}
    assert names[3, 11] - names[3, 13] == {"typing-extensions"}  # rosbags needs it below 3.12
    assert names[3, 13] - names[3, 14] == {"backports-zstd"}  # and this below 3.14


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
    with pytest.raises(HostFailed, match=r"there is no wheel of numpy==[\d.]+ for cp311-aarch64-glibc2\.36; install a"):
        made(tmp_path, wheels)
    assert not list((tmp_path / "cache").glob("*.part"))


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"machine": "armv7l", "bits": 32}, "expected aarch64 or x86_64 with 64 bits, got armv7l with 32 bits"),
        ({"bits": 32}, "got aarch64 with 32 bits"),
        ({"libc": ["", ""]}, "expected CPython on Linux with glibc, got cpython on Linux with another C library"),
        ({"implementation": "pypy"}, "got pypy on Linux with glibc"),
    ],
)
def test_a_platform_without_wheels_is_refused(changed, expected):
    with pytest.raises(HostFailed, match=expected):
        Target.of({**PI, **changed})


def test_an_archive_is_the_same_for_the_same_files(tmp_path):
    entries = [Entry("b", b"2"), Entry("a", b"1", 0o600), Entry("c", link="../a")]
    one, two = write_archive(entries, tmp_path / "1"), write_archive(entries[::-1], tmp_path / "2")
    assert (one.name, one.sha256, one.size) == (two.name, two.sha256, two.size)
    others = [[Entry("b", b"2")], [Entry("b", b"2", 0o755)], [Entry("b", b"3")], [Entry("c", b"2")]]
    assert len({name_of(entries), *map(name_of, others)}) == 5


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
