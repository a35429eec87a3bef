"""Packages of robots: which, at which versions, and for which platform."""

import sys

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.fleet.packages import Target, pins
from swarmwire.deploy.fleet.release import Entry, name_of, write_archive
from swarmwire.deploy.fleet.result import HostFailed

PI = {
    "system": "Linux", "implementation": "cpython", "libc": ["glibc", "2.36"], "machine": "aarch64", "bits": 64,
    "python": [3, 11, 2],
}  # fmt: skip


def test_an_agent_needs_three_packages_beside_swarmwire_and_a_driver_its_own():
    assert [pin.name for pin in pins(["epuck2"], [], (3, 11))] == ["eclipse-zenoh", "msgpack", "msgspec", "numpy"]
    assert {"rosbags", "lz4", "ruamel-yaml"} <= {pin.name for pin in pins(["ros2"], [], sys.version_info[:2])}
    assert "scipy" in [pin.name for pin in pins(["epuck2"], ["scipy"], (3, 11))]
    with pytest.raises(BadInput, match="^packages: not-there: "):
        pins(["epuck2"], ["not-there"], (3, 11))


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="what older versions need is not installed here")
def test_what_only_some_versions_of_python_need_goes_to_robots_that_have_them():
    names = {python: {pin.name for pin in pins(["ros2"], [], python)} for python in ((3, 11), (3, 13), (3, 14))}
    assert names[3, 11] - names[3, 13] == {"typing-extensions"}  # rosbags needs it below 3.12
    assert names[3, 13] - names[3, 14] == {"backports-zstd"}  # and this below 3.14


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"machine": "armv7l", "bits": 32}, "got armv7l with 32 bits"),
        ({"bits": 32}, "got aarch64 with 32 bits"),
        ({"libc": ["", ""]}, "another C library"),
        ({"implementation": "pypy"}, "got pypy"),
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
