from swarmwire.agent.on_robot.presence import Presence
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.wire.poses import Pose
from tests.support.clocks import FakeClock

HERE = Pose(0.0, 0.0, 0.0)


class _Swarm:
    """What a robot among k-1 and k-2 hears and sees, looked at once a second."""

    def __init__(self, pace: float = 1.0) -> None:
        self.clock, self.said, self.heard = FakeClock(), list[str](), set[str]()
        self.pose: Pose | None = None
        others = ("k-1", "k-2")
        self.presence = Presence(self.clock, self.said.append, others, lambda: self.heard, lambda: self.pose, pace)

    def seconds(self, n: int) -> list[str]:
        """What it says in so many seconds."""
        self.said.clear()
        for _ in range(n):
            self.clock.time_ns += NS_PER_S
            self.presence.look()
        return list(self.said)


def test_others_that_were_never_heard_are_told_once_after_five_seconds_and_when_they_come():
    swarm = _Swarm()
    swarm.pose = HERE
    assert swarm.seconds(4) == []
    assert swarm.seconds(10) == ["radio: hears none of k-1, k-2"]
    swarm.heard.add("k-2")
    assert swarm.seconds(3) == ["radio: now hears k-2"]
    swarm.heard.add("k-1")
    assert swarm.seconds(3) == ["radio: now hears k-1"]


def test_those_that_were_heard_in_time_are_not_told_of():
    swarm = _Swarm()
    swarm.pose, swarm.heard = HERE, {"k-1"}
    assert swarm.seconds(9) == ["radio: has never heard k-2"]


def test_poses_that_do_not_come_are_told_of_and_counted_and_again_when_they_come():
    swarm = _Swarm()
    swarm.heard = {"k-1", "k-2"}
    assert swarm.seconds(9) == ["tracker: no pose of this robot has come for 5 s"]
    swarm.pose = HERE
    assert swarm.seconds(9) == ["tracker: poses come"]
    assert swarm.presence.counts() == {"seconds_without_pose": 9}
    swarm.pose = None
    assert swarm.seconds(4) == []
    assert swarm.seconds(1) == ["tracker: no pose of this robot has come for 5 s"]
    assert swarm.presence.counts() == {"seconds_without_pose": 14}


def test_seconds_are_the_walls_however_fast_the_robot_is():
    assert _Swarm(pace=10.0).seconds(49) == []
