"""Recorded runs of emulated bases pass the checks of slam_toolbox, Nav2 and tf2."""

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
