"""Whether a robot hears the others of its swarm, and is seen by the tracker: told once when it is not, and when it is.

A wrong endpoint, a firewall or a camera that is off look like a quiet swarm: only time tells.
"""

from collections.abc import Callable, Collection, Sequence

from swarmwire.comms.clock import NS_PER_S, Clock, to_ns
from swarmwire.comms.wire.radio_bridge import Pose

PATIENCE_S = 5.0


class Presence:
    """Looks when it is told to; without a radio or a tracker there is nothing to be missed."""

    def __init__(
        self,
        clock: Clock,
        say: Callable[[str], None],
        others: Sequence[str] = (),
        heard: Callable[[], Collection[str]] = tuple,
        pose: Callable[[], Pose | None] | None = None,
        pace: float = 1.0,
    ) -> None:
        """`others` are to be heard, and `heard` tells which ever were; `pose` is the robot's newest, with a tracker."""
        self._clock, self._say, self._heard, self._pose = clock, say, heard, pose
        self._patience_ns = to_ns(PATIENCE_S * pace)
        self._silent, self._others = list(others), others
        self._began_ns = self._looked_ns = self._seen_ns = clock.now_ns()
        self._told_silent = self._told_unseen = False
        self._without_pose_ns = 0

    def look(self) -> None:
        """Tell what is missing for too long, and what has come since that was told."""
        now_ns = self._clock.now_ns()
        self._listen(now_ns)
        if self._pose is not None:
            self._watch(now_ns, self._pose() is not None)
        self._looked_ns = now_ns

    def counts(self) -> dict[str, int]:
        """For how many seconds no pose came, by name."""
        return {"seconds_without_pose": self._without_pose_ns // NS_PER_S}

    def _listen(self, now_ns: int) -> None:
        if not self._silent:
            return
        heard = set(self._heard())
        came = [robot for robot in self._silent if robot in heard]
        self._silent = [robot for robot in self._silent if robot not in heard]
        if self._told_silent and came:
            self._say(f"radio: now hears {', '.join(came)}")
        if self._silent and not self._told_silent and now_ns - self._began_ns >= self._patience_ns:
            self._told_silent = True
            how = "hears none of" if len(self._silent) == len(self._others) else "has never heard"
            self._say(f"radio: {how} {', '.join(self._silent)}")

    def _watch(self, now_ns: int, seen: bool) -> None:
        if seen:
            self._seen_ns = now_ns
            if self._told_unseen:
                self._told_unseen = False
                self._say("tracker: poses come")
            return
        self._without_pose_ns += now_ns - self._looked_ns
        if not self._told_unseen and now_ns - self._seen_ns >= self._patience_ns:
            self._told_unseen = True
            self._say(f"tracker: no pose of this robot has come for {PATIENCE_S:g} s")
