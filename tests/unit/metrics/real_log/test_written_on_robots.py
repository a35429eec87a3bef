"""What the robots' own code writes is read back, and measured as the run was."""

import numpy as np
import pytest

from swarmwire.agent.behaviours import Flocking
from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.on_robot.assembly import robot_facts
from swarmwire.agent.on_robot.log import TickRow, new_log
from swarmwire.agent.on_robot.plan import RobotConfig, SpeedLimits
from swarmwire.agent.on_robot.settings import DriverSettings, RobotSettings
from swarmwire.agent.radios.radio import ReceivedPacket, SentPacket
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.wire.radio_bridge import Pose
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.metrics.real.real_log.real_logs import read_real_logs
from swarmwire.metrics.real.real_log.robot_log import read_robot_log
from swarmwire.metrics.real.sim_to_real.runs import measured_log
from tests.support.agent.on_robot.scripted import UTC_NS, DatedFakeClock, ScriptedDriver
from tests.support.metrics.real_logs import as_logs, flock

MEASURES = [
    METRICS[name]() for name in ("order", "speed", "cohesion", "min_gap", "throughput", "link_pdr", "latency_air")
]


@pytest.fixture
def folders(tmp_path):
    """The run's truth, by the code of the robots and by that of the tests."""
    return by_robots(tmp_path / "robots"), as_logs(flock(), tmp_path / "tests")


def by_robots(folder):
    static, clock = flock().static, DatedFakeClock()
    made_up = as_logs(flock(), folder.with_name("made-up"))
    for robot, name in enumerate(static.robot_names):
        settings = RobotSettings(
            agent="swarmwire.agent.behaviours:Flocking",
            driver=DriverSettings("epuck2"),
            name=name,
            swarm="lab",
            robots=static.robot_names,
        )
        log = new_log(folder, static.robot_names, name, "20261121T120000Z", "robot.toml")
        body = static.groups[0].body
        plan = RobotConfig(settings, "robot.toml", Flocking, {}, body, ScriptedDriver(clock), SpeedLimits(0.1, 2.0))
        log.begin(robot_facts(plan, clock))
        for truth in flock().truths:
            x_m, y_m, heading_rad = truth.pose[robot].tolist()
            command = Command(*truth.command[robot, :2].tolist())
            pose = Pose(x_m, y_m, heading_rad)
            log.tick(TickRow(truth.tick, UTC_NS + truth.time_ns, False, pose, True, command, 'say "a, b"', 1.5, None))
        source = read_robot_log(made_up / name)
        begin_s = source.steps.time_s[0]
        for at_s, sequence, size in zip(source.sent.time_s, source.sent.sequence, source.sent.size_bytes, strict=True):
            log.sent(SentPacket(UTC_NS + to_ns(at_s - begin_s), int(sequence), BROADCAST, int(size), 7, "sent"))
        received = source.received
        for row in range(len(received.sequence)):
            at_ns = UTC_NS + to_ns(received.time_s[row] - begin_s)
            sender, latency_ns = static.robot_names.index(received.sender[row]), to_ns(received.latency_s[row])
            log.received(
                ReceivedPacket(
                    at_ns, sender, int(received.sequence[row]), BROADCAST, 14, 7, latency_ns, None, delivered=True
                )
            )
            if row == len(received.sequence) // 2:
                log.flush()
        log.end({"ended": "stopped", "ticks": len(flock().truths)})
    return folder


def test_logs_that_robots_write_are_read_back(folders):
    logs = read_real_logs(folders[0])
    assert logs.notes == ()
    assert logs.names == flock().static.robot_names
    steps = logs.robots[2].steps
    assert steps.time_s[0] == UTC_NS / NS_PER_S
    assert steps.state[0] == 'say "a, b"'
    assert steps.value[0] == 1.5
    np.testing.assert_allclose(steps.pose[:, 0], [truth.pose[2, 0] for truth in flock().truths])
    assert np.isnan(logs.robots[2].received.distance_m).all()
    assert set(logs.robots[2].received.to.tolist()) == {""}
    assert logs.robots[0].about.agent_sha256 != ""
    assert logs.robots[0].ended == "stopped"


def test_logs_that_robots_write_measure_as_those_that_tests_write(folders):
    by_robots_, by_tests = (measured_log(read_real_logs(folder), MEASURES, flock().static) for folder in folders)
    for name, series in by_robots_.series.items():
        np.testing.assert_allclose(series, by_tests.series[name], rtol=1e-4, atol=1e-4, err_msg=name)
    assert by_robots_.radio["fates"] == by_tests.radio["fates"]
