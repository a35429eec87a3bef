"""Environments that are made on robots, and their logs."""

import io
import platform
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path
from threading import Event

import pytest

from swarmwire.deploy.robots import connecting, host_session, logs
from swarmwire.deploy.robots.archives import Archive
from swarmwire.deploy.robots.host_side.files import Refusal, unpack
from swarmwire.deploy.robots.packages import LockedEnvironments, RobotPlatform, pins
from swarmwire.deploy.robots.result import HostFailed
from tests.support.deploy.fleet.hosts import PYTHON

TARGET = RobotPlatform((3, 11), "aarch64", (2, 36))
OF_PI = "cp39-abi3-manylinux_2_28_aarch64"
LONG_S = 100.0  # for which a host is frozen, unless it is thawed


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
    for pin in pins(["epuck2"], [], TARGET):
        files = {
            f"{pin.name}_small.py": "x = 1", f"{pin.name}_small.pyi": "x: int", "numpy/tests/test_it.py": "",
            f"{pin.name}-{pin.version}.data/purelib/of_data_{pin.name.replace('-', '_')}.py": "",
            f"{pin.name}-{pin.version}.data/scripts/tool": "",
        }  # fmt: skip
        wheel(folder, pin.name, pin.version, OF_PI, **files)
    return folder


def archives(tmp_path: Path, wheels: Path) -> list[Archive]:
    """The packages of a robot with an e-puck2, from these wheels alone."""
    index = ("--no-index", "--find-links", str(wheels))
    return LockedEnvironments(tmp_path / "cache", index).archives(TARGET, ["epuck2"], [])


def names(archive: Archive) -> set[str]:
    with tarfile.open(archive.path) as tar:
        return set(tar.getnames())


def test_archive_of_wheels_excludes_unused_files(tmp_path, wheels):
    swarmwire, others = archives(tmp_path, wheels)
    assert {"swarmwire/agent/cli.py", "swarmwire/comms/base/clock.py"} <= names(swarmwire)
    about = f"swarmwire_agent-{version('swarmwire-agent')}.dist-info/entry_points.txt"
    assert any(name.endswith(about) for name in names(swarmwire))
    assert not any("__pycache__" in name for name in names(swarmwire))
    packed = names(others)
    assert {"numpy_small.py", "msgpack_small.py", "of_data_eclipse_zenoh.py"} <= packed
    assert not any(name.endswith((".pyi", "tool")) or "/tests/" in name for name in packed)


def test_archives_are_cached(tmp_path, wheels):
    first = archives(tmp_path, wheels)
    for path in wheels.iterdir():
        path.unlink()
    assert archives(tmp_path, wheels) == first


def test_missing_wheel_for_the_platform_is_named(tmp_path, wheels):
    next(wheels.glob("numpy*")).unlink()
    with pytest.raises(HostFailed, match=r"numpy==[\d.]+ for cp311-aarch64-glibc2\.36"):
        archives(tmp_path, wheels)
    assert not list((tmp_path / "cache").glob("*.part"))


@pytest.mark.slow
@pytest.mark.parametrize(("python", "glibc"), [((3, 11), (2, 36)), ((3, 13), (2, 41))])
@pytest.mark.parametrize("driver", ["epuck2", "ros2"])
def test_index_has_wheels_for_a_raspberry_pi(tmp_path, python, glibc, driver):
    target = RobotPlatform(python, "aarch64", glibc)
    _, others = LockedEnvironments(tmp_path).archives(target, [driver], [])
    assert any(name.endswith("zenoh.abi3.so") for name in names(others))


@pytest.mark.slow
def test_archives_for_this_machine_run_the_agents_program(tmp_path):
    libc = platform.libc_ver()[1].split(".")
    target = RobotPlatform(sys.version_info[:2], platform.machine(), (int(libc[0]), int(libc[1])))
    paths = []
    for i, archive in enumerate(LockedEnvironments(tmp_path).archives(target, ["epuck2"], [])):
        paths.append(str(tmp_path / str(i)))
        with tarfile.open(archive.path) as tar:
            tar.extractall(paths[-1], filter="data")
    command, environment = [PYTHON, "-P", "-m", "swarmwire.agent.cli", "drivers"], {"PYTHONPATH": ":".join(paths)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert "epuck2" in done.stdout, done.stderr


@pytest.fixture
def frozen(fleet, packages, monkeypatch):
    """A host that freezes in the middle of a deployment, with what it waited for."""
    monkeypatch.setattr(connecting, "KEEPALIVE_INTERVAL_S", 0.1)
    thaw, waited = Event(), list[bool]()
    host = fleet.add("flock-0")
    packages.size, host.cut_after = 400_000, 70_000
    host.before_cut = lambda: waited.append(thaw.wait(LONG_S))
    yield waited
    thaw.set()


def test_host_that_freezes_is_reported_as_lost(robots, frozen):
    code, lines = robots("deploy")
    assert code == 1
    assert "connection was lost" in lines[0]
    assert frozen == []  # it has not gone on yet


def test_host_without_answers_is_reported_after_the_timeout(fleet, robots, monkeypatch):
    monkeypatch.setattr(host_session, "TIMEOUT_S", 0.2)
    fleet.add("flock-0").set_python("exec cat > /dev/null")
    code, lines = robots("deploy")
    assert code == 1
    assert "within 0.2 s" in lines[0]


@pytest.fixture
def sends(fleet, robots, tmp_path, monkeypatch):
    """What comes of a fetch of which the host sends this, where a log may have 10 kB."""
    host = fleet.add("flock-0")
    (host.root / "flock-0" / "log" / "flock-0-1").mkdir(parents=True)
    monkeypatch.setattr(logs, "MAX_BYTES", 10_000)

    def fetched(command):
        host.set_program("tar", f"exec {command}")
        return robots("logs", "--fetch", tmp_path / "logs")

    return fetched


def test_fetch_of_an_endless_log_ends_at_its_limit(sends, tmp_path):
    code, lines = sends("head -c 100000000 /dev/zero")  # as good as endless, but for a fetch that has no limit
    assert code == 1
    assert "larger than" in lines[0]
    assert "~/swarmwire/flock-0/log" in " ".join(lines)
    assert list((tmp_path / "logs").iterdir()) == []


def test_fetch_of_a_small_archive_of_a_large_log_ends_at_its_limit(fleet, sends, tmp_path):
    small = tmp_path / "small"
    small.write_bytes(packed(member("robot.json", data=bytes(20_000))))
    assert small.stat().st_size < 1_000
    code, lines = sends(f"cat {small}")
    assert code == 1
    assert "10000 bytes" in lines[0]
    assert list((tmp_path / "logs").iterdir()) == []


def test_unpack_counts_empty_files(tmp_path):
    archive = tmp_path / "many"
    archive.write_bytes(packed(*(member(f"empty-{number}") for number in range(100))))
    with archive.open("rb") as file, pytest.raises(Refusal, match="10000 bytes"):
        unpack(file, tmp_path / "log", max_bytes=10_000)


Member = tuple[tarfile.TarInfo, bytes]


def member(name: str, kind: bytes = tarfile.REGTYPE, link: str = "", data: bytes = b"") -> Member:
    info = tarfile.TarInfo(name)
    info.type, info.linkname, info.size = kind, link, len(data)
    return info, data


def packed(*members: Member) -> bytes:
    archives = io.BytesIO()
    with tarfile.open(fileobj=archives, mode="w:gz") as tar:
        for info, data in members:
            tar.addfile(info, io.BytesIO(data))
    return archives.getvalue()


TWICE = member("robot.json", data=b"{}")
HOSTILE = {
    "a path above": packed(member("../outside", data=b"x")),
    "a path of the machine": packed(member("/tmp/outside", data=b"x")),
    "a link and a file through it": packed(member("out", tarfile.SYMTYPE, ".."), member("out/outside", data=b"x")),
    "a hard link": packed(member("robot.json", tarfile.LNKTYPE, "../../fleet.toml")),
    "one file twice": packed(TWICE, TWICE),
    "half of an archive": packed(member("robot.json", data=b"{}" * 1000))[:40],
    "no archive": b"what is this?",
    "nothing": b"",
}


@pytest.mark.parametrize("sent", HOSTILE.values(), ids=HOSTILE.keys())
def test_fetch_of_a_hostile_archive_leaves_nothing(sends, tmp_path, sent):
    (tmp_path / "sent").write_bytes(sent)
    code, lines = sends(f"cat {tmp_path}/sent")
    assert code == 1
    assert lines[0].startswith("flock-0 failed: its log cannot be unpacked: ")
    assert len(lines) == 2
    assert not list((tmp_path / "logs").iterdir())
    assert not list(tmp_path.rglob("outside"))
