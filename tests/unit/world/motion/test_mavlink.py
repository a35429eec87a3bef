"""Poses by MAVLink: messages of pymavlink as datagrams; tests/integration/deploy/test_motion.py sends them by UDP."""

from collections.abc import Iterator
from math import pi, radians
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as version_1
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as version_2

from swarmwire.comms.base.clock import NEVER_NS as FOREVER_NS
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.mavlink import MavlinkSource
from swarmwire.world.scenario.motion import MavlinkMotion
from tests.support.clocks import FakeClock, GoingClock

NAMES = ("drones-0", "drones-1")
ROWS = (4, 5)
ORIGIN = (55.0, 5.0, 200.0)
UNKNOWN_HDG = 65_535


@pytest.fixture
def source(request: pytest.FixtureRequest) -> Iterator[MavlinkSource]:
    """A source with the settings of the test's parameter that receives on a port that the system chose."""
    motion = MavlinkMotion(
        source="mavlink", listen="udp:127.0.0.1:0", max_speed_mps=1e5, max_age_s=3600.0, **request.param
    )
    made = MavlinkSource(motion, NAMES, ROWS, (1e6, 1e6), GoingClock(NS_PER_S))
    made.open()
    yield made
    made.close()


local, earthly, stamped = ({}, {"origin": ORIGIN}, {"stamps": True})


def packed(message: Any, system: int = 1, component: int = 1, dialect: Any = version_2) -> bytes:
    return message.pack(dialect.MAVLink(None, srcSystem=system, srcComponent=component))


def at(x: float, y: float, z: float, dialect: Any = version_2, boot_ms: int = 0) -> Any:
    return dialect.MAVLink_local_position_ned_message(boot_ms, x, y, z, 0.0, 0.0, 0.0)


def facing(yaw_rad: float) -> Any:
    return version_2.MAVLink_attitude_message(0, 0.3, -0.2, yaw_rad, 0.0, 0.0, 0.0)


def fix(latitude: int, longitude: int, altitude_mm: int, hdg: int = UNKNOWN_HDG) -> Any:
    return version_2.MAVLink_global_position_int_message(0, latitude, longitude, altitude_mm, 0, 0, 0, 0, hdg)


def poses(source: MavlinkSource) -> dict[int, list[float]]:
    """New poses by row."""
    table, rows = source.pop_new(FOREVER_NS), dict[int, list[float]]()
    for row, value in zip(table.rows.tolist(), table.value.tolist(), strict=True):
        rows.setdefault(row, []).append(value)
    return rows


@pytest.mark.parametrize("source", [stamped], indirect=True)
def test_mavlink_message_with_an_older_time_since_boot_is_late(source: MavlinkSource) -> None:
    source.take(packed(at(1.0, 2.0, -3.0, boot_ms=500)) + packed(at(0.0, 0.0, -3.0, boot_ms=499)))
    assert poses(source) == {4: [2.0, 1.0, 3.0]}
    assert source.counts() == {"poses_late": 1}


@pytest.mark.parametrize("source", [local], indirect=True)
def test_mavlink_local_position_becomes_east_north_up_with_the_yaw_of_attitude(source: MavlinkSource) -> None:
    source.take(packed(at(1.0, 2.0, -3.0)) + packed(fix(550000000, 50000000, 0)))
    assert poses(source) == {4: [2.0, 1.0, 3.0]}
    source.take(packed(facing(pi / 2)) + packed(at(1.0, 2.0, -3.0)) + packed(facing(-0.75 * pi), 2))
    source.take(packed(at(0.0, 0.5, 0.0, version_1), 2, dialect=version_1))
    assert poses(source) == {
        4: pytest.approx([2.0, 1.0, 3.0, 0.0], abs=1e-6),
        5: pytest.approx([0.5, 0.0, 0.0, -0.75 * pi]),
    }
    assert source.counts() == {}


# The example of EPSG method 9837 in Guidance Note 7-2, with the degrees of PROJ's page on "topocentric".
@pytest.mark.parametrize("source", [earthly], indirect=True)
def test_mavlink_global_position_is_east_north_and_up_of_the_origin(source: MavlinkSource) -> None:
    source.take(packed(fix(538093944, 21295500, 73000, 18000)) + packed(fix(550000000, 50000000, 230_500), 2))
    source.take(packed(at(7.0, 7.0, 7.0)))
    expected = [-189013.869, -128642.040, -4220.171, -pi / 2]  # south
    assert poses(source) == {4: pytest.approx(expected, abs=1e-2), 5: pytest.approx([0.0, 0.0, 30.5], abs=1e-6)}
    source.take(packed(fix(550000000, 50000000, 200_000, 31500), 2))
    assert poses(source)[5][3] == pytest.approx(radians(135.0))


@pytest.mark.parametrize("source", [local | {"systems": (7, 3)}], indirect=True)
def test_mavlink_systems_are_robots_and_others_count_as_unknown(source: MavlinkSource) -> None:
    for system in (3, 7, 1):
        source.take(packed(at(float(system), 0.0, 0.0), system))
    assert {row: pose[1] for row, pose in poses(source).items()} == {4: 7.0, 5: 3.0}
    assert source.counts() == {"poses_of_unknown": 1}


@pytest.mark.parametrize("source", [local], indirect=True)
def test_mavlink_other_components_and_messages_are_ignored(source: MavlinkSource) -> None:
    camera, ekf = 100, ardupilotmega.MAVLink_ekf_status_report_message(0, 0.0, 0.0, 0.0, 0.0, 0.0)
    source.take(packed(at(9.0, 9.0, 9.0), component=camera) + packed(ekf, dialect=ardupilotmega))
    assert (poses(source), source.counts()) == ({}, {})


@pytest.mark.parametrize("source", [local], indirect=True)
def test_mavlink_damaged_message_is_counted_and_the_next_one_taken(source: MavlinkSource) -> None:
    damaged = bytearray(packed(at(1.0, 2.0, 3.0)))
    damaged[12] ^= 1
    source.take(bytes(damaged))
    source.take(packed(at(float("nan"), 0.0, 0.0)))
    source.take(packed(at(4.0, 5.0, 6.0)))
    assert poses(source) == {4: [5.0, 4.0, -6.0]}
    assert source.counts() == {"poses_malformed": 2}


@pytest.mark.parametrize("source", [local], indirect=True)
def test_mavlink_random_bytes_give_no_pose(source: MavlinkSource) -> None:
    @given(st.lists(st.binary(max_size=60) | st.sampled_from([b"\xfd\x1c", b"\xfe\x1c\x00"]), max_size=6))
    def sent(datagrams: list[bytes]) -> None:
        for datagram in datagrams:
            source.take(datagram)
        assert poses(source) == {}
        source.take(packed(at(1.0, 2.0, -3.0)))
        assert poses(source) == {4: [2.0, 1.0, 3.0]}

    sent()


@pytest.mark.parametrize("systems", [(1,), (1, 1), (1, 2, 3)])
def test_mavlink_needs_a_system_id_for_each_robot(systems: tuple[int, ...]) -> None:
    motion = MavlinkMotion(source="mavlink", listen="127.0.0.1:0", systems=systems)
    with pytest.raises(BadInput) as error:
        MavlinkSource(motion, NAMES, ROWS, (1.0, 1.0), FakeClock()).open()
    assert error.value.key == "systems"


def test_mavlink_without_pymavlink_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"install swarmwire\[mavlink\]"):
        MavlinkSource(MavlinkMotion(source="mavlink"), NAMES, ROWS, (1.0, 1.0), FakeClock()).open()
