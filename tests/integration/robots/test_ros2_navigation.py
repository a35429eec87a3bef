"""Recorded runs of emulated bases pass the checks of slam_toolbox, Nav2 and tf2, which find faults that are put in."""

import copy
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from swarmwire.comms.protocols.ros2.links import close, open_client
from swarmwire.deploy import Simulation
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.navigation import (
    ODOM,
    Pose,
    Recording,
    TransformBuffer,
    combined,
    faults_of,
    points_in,
)
from tests.support.deploy.runs import ROOT

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false

SIZE_M = (4.0, 3.0)
TICKS = 60
PACE = 10.0
TOPICS = {
    "scans": ("wanderers_0/scan", independent.LaserScan),
    "odometry": ("wanderers_0/odom", independent.Odometry),
    "moved": ("wanderers_0/tf", independent.TFMessage),
    "still": ("wanderers_0/tf_static", independent.TFMessage),
    "clock": ("clock", independent.Clock),
}
DELAYED, DELAY_S = "avoidance-turtlebot, a late scanner", 0.5
LIMITS = {  # range in m, speed in m/s
    "avoidance-turtlebot": (3.5, 0.22),
    "avoidance-turtlebot4": (12.0, 0.306),
    DELAYED: (3.5, 0.22),
}
SCENARIOS = pytest.mark.parametrize("scenario", LIMITS)


@cache
def recorded(scenario: str) -> tuple[Recording, Pose]:
    """Return the messages of a base alone in an arena on a curve, and the pose of odom in the arena."""
    overrides = ["robots.wanderers.count=1", "arena.obstacles=[]", f"arena.size_m={[*SIZE_M]}"]
    overrides += ['robots.wanderers.place={how="poses",poses=[[0.0,-0.5,0.7]]}', "duration_s=60"]
    folder = ROOT / "scenarios" / "robots"
    path = folder / f"{scenario.partition(',')[0]}.toml"
    with TemporaryDirectory() as bodies:
        if scenario == DELAYED:
            late = Path(bodies) / "late.toml"
            late.write_text(f"{(folder / 'turtlebot.toml').read_text()}\n[sensors.scan]\ndelay_s = {DELAY_S}\n")
            overrides.append(f"robots.wanderers.body={late}")
        return played(path, overrides)


def played(path: Path, overrides: list[str]) -> tuple[Recording, Pose]:
    """The recording of a run of this scenario."""
    recording = Recording()
    with Simulation(path, gateways="ros2", realtime=PACE, overrides=overrides) as simulation:
        assert simulation.served is not None
        x_m, y_m, heading_rad = map(float, simulation.world.pose[0])
        session = open_client(simulation.served.robots[0].address, 5.0)
        try:
            for name, (key, kind) in TOPICS.items():
                messages = getattr(recording, name)
                session.declare_subscriber(
                    key,
                    lambda sample, messages=messages, kind=kind: messages.append(
                        kind.deserialize(sample.payload.to_bytes())
                    ),
                )
            twist = independent.twist(0.15, 0.4).serialize()
            while simulation.tick < TICKS or (simulation.tick < 5 * TICKS and not all(vars(recording).values())):
                session.put("wanderers_0/cmd_vel", twist)
                simulation.run(simulation.tick + 1)
            until(lambda: not late_scans(recording))
        finally:
            close(session)
    return without_early_scans(recording), (x_m, y_m, heading_rad)


def late_scans(recording: Recording) -> list[independent.LaserScan]:
    """Scans whose transform is still on its way."""
    last_ns = independent.stamp_ns(recording.moved[-1].transforms[0].header)
    return [message for message in recording.scans if independent.stamp_ns(message.header) > last_ns]


def test_late_scan_has_the_stamp_of_its_measurement():
    recording, _ = recorded(DELAYED)
    clock_ns = [message.clock.sec * 10**9 + message.clock.nanosec for message in recording.clock]
    assert max(clock_ns) - independent.stamp_ns(recording.scans[-1].header) >= DELAY_S * 1e9


def without_early_scans(recording: Recording) -> Recording:
    """Remove messages before the first transform, which a tf2 message filter drops, too."""
    first_ns = independent.stamp_ns(recording.moved[0].transforms[0].header)
    for messages in (recording.scans, recording.odometry):
        messages[:] = [message for message in messages if independent.stamp_ns(message.header) >= first_ns]
    return recording


@SCENARIOS
def test_recorded_run_passes_the_checks_of_tf2_slam_toolbox_and_nav2(scenario):
    recording, _ = recorded(scenario)
    assert len(recording.scans) > 20
    assert len(recording.odometry) > 40
    turned = recording.odometry[-1].pose.pose.orientation.z - recording.odometry[0].pose.pose.orientation.z
    assert abs(turned) > 0.1  # it drove
    assert faults_of(recording, *LIMITS[scenario]) == []


@SCENARIOS
def test_scan_returns_lie_on_the_walls_of_the_arena(scenario):
    recording, start = recorded(scenario)
    buffer = TransformBuffer(recording)
    points = np.concatenate([points_in(buffer, scan, ODOM) for scan in recording.scans])
    assert len(points) > 5000
    in_arena = np.array([combined(start, (x_m, y_m, 0.0))[:2] for x_m, y_m in points])
    from_wall_m = np.abs(np.divide(SIZE_M, 2) - np.abs(in_arena)).min(axis=1)
    # With the scanner a quarter turn off: 1.0; with the late scanner stamped when it is published: 0.43.
    assert np.quantile(from_wall_m, 0.99) < 0.1


Change = Callable[[Recording], object]


def transform(**changed: object) -> Change:
    """One of the transforms is another: of its parts, of its translation or of its rotation."""

    def change(recording: Recording) -> None:
        moved = recording.moved[5].transforms[0]
        for part in (moved, moved.header, moved.transform.translation, moved.transform.rotation):
            vars(part).update({name: value for name, value in changed.items() if name in vars(part)})

    return change


def scan(**changed: object) -> Change:
    """One of the scans is another."""
    return lambda recording: vars(recording.scans[3]).update(changed)


def odometry(**changed: object) -> Change:
    """One of the poses is another."""

    def change(recording: Recording) -> None:
        pose = recording.odometry[9].pose.pose
        for part in (pose.position, pose.orientation):
            vars(part).update({name: value for name, value in changed.items() if name in vars(part)})

    return change


def twists(turned_around: independent.Twist) -> Change:
    return lambda recording: [setattr(message.twist, "twist", turned_around) for message in recording.odometry]


def swapped(recording: Recording) -> None:
    recording.moved[5], recording.moved[6] = recording.moved[6], recording.moved[5]


NAMELESS = independent.header(10**18, "")
FAULTS: dict[str, tuple[Change, str]] = {
    "a transform from the past": (swapped, "TF_OLD_DATA"),
    "a frame in itself": (transform(child_frame_id=ODOM), "TF_SELF_TRANSFORM"),
    "no child": (transform(child_frame_id=""), "TF_NO_CHILD_FRAME_ID"),
    "no frame": (transform(frame_id=""), "TF_NO_FRAME_ID"),
    "not a number": (transform(x=float("nan")), "TF_NAN_INPUT"),
    "a long quaternion": (transform(w=2.0), "TF_DENORMALIZED_QUATERNION"),
    "two parents": (transform(frame_id="map"), "two parents"),
    "no static frames": (lambda recording: recording.still.clear(), "LookupException"),
    "transforms that end early": (
        lambda recording: recording.moved.__delitem__(slice(20, None)),
        "ExtrapolationException",
    ),
    "a scan of no frame": (scan(header=NAMELESS), "header"),
    "a frame with a slash": (scan(header=independent.header(10**18, "/base_scan")), "header"),
    "a ray too few": (lambda recording: recording.scans[3].ranges.pop(), "number of range readings"),
    "the angle after the last": (scan(angle_max=6.4), "number of range readings"),
    "clockwise rays": (scan(angle_increment=-0.01745), "angle_increment"),
    "no range": (scan(range_max=0.0), "range_max"),
    "ranges that cannot be": (scan(range_min=50.0), "range threshold"),
    "rays after the last transform": (scan(time_increment=1.0), "ExtrapolationException"),
    "scans in no order": (lambda recording: recording.scans.reverse(), "stamps do not rise"),
    "a clock that lags": (lambda recording: recording.clock.__delitem__(slice(1, None)), "ahead of the clock"),
    "a jump": (odometry(x=9.0), "a jump in odom"),
    "another pose than tf": (odometry(y=1e-3), "odometry and tf differ"),
    "an orientation of another length": (odometry(w=2.0), "orientation"),
    "a negative variance": (lambda recording: recording.odometry[9].pose.covariance.__setitem__(0, -1.0), "covariance"),
    "a base that drives backwards": (twists(independent.twist(-0.15, 0.4)), "x is not ahead"),
    "clockwise turns": (twists(independent.twist(0.15, -0.4)), "turns are not counter-clockwise"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_checks_find_a_fault_in_a_recording(fault):
    recording = copy.deepcopy(recorded("avoidance-turtlebot")[0])
    change, name = FAULTS[fault]
    change(recording)
    assert name in faults_of(recording, *LIMITS["avoidance-turtlebot"])
