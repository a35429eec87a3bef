"""Crews in real time: each act ends when its tick is over by the wall clock, whoever has answered by then."""

# pyright: reportUnknownMemberType=false

from dataclasses import dataclass, field

import zenoh

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import Clock, to_s
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.protocols import Crew
from swarmwire.comms.senses import Actions, Senses
from swarmwire.world.crews.pace import Pace
from swarmwire.world.crews.realtime import RealTime
from swarmwire.world.crews.roster import OnLoss
from swarmwire.world.crews.runner_crew import RunnerCrew, Surroundings
from swarmwire.world.crews.terms import USUAL, Terms


@dataclass(frozen=True)
class RealTimeReport:
    """What a run in real time did not manage; all 0 and empty if it kept up."""

    factor: float  # simulated s per s of wall time
    missed_ticks: int  # that were over before the loop came to wait for it: the next one started late
    worst_lag_s: float  # by how much at most, wall time
    late_answers: dict[str, int] = field(default_factory=dict[str, int])  # after their own tick, by robot
    watchdog_stops: dict[str, int] = field(default_factory=dict[str, int])  # by robot
    frames_dropped: int = 0  # to runners, never acted on: middleware loss
    packets_dropped: int = 0  # in these frames: heard by the radio, never by the agent
    outcomes_dropped: int = 0  # in these frames: what radios knew of packets sent, and agents never learned


class PacedCrew:
    """A crew in this process, paced by the wall clock: an agent that takes too long makes the loop lag."""

    def __init__(self, crew: Crew, pace: Pace) -> None:
        self._crew, self._pace = crew, pace
        self.start, self.counts, self.close = crew.start, crew.counts, crew.close

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES) -> Actions:
        """What every robot does in this tick."""
        self._pace.begin()
        actions = self._crew.act(tick, senses, heard, outcomes)
        self._pace.hold(tick)
        return actions

    def report(self) -> RealTimeReport:
        """How far the loop kept up."""
        return RealTimeReport(self._pace.factor, self._pace.missed_ticks, to_s(self._pace.worst_lag_ns))


class RealTimeCrew(RunnerCrew[RealTime]):
    """All agents of a run in runners, none of which the loop waits for; `realtime` decides, this carries the bytes."""

    congestion = zenoh.CongestionControl.DROP  # a runner that reads nothing must not hold up the world

    def __init__(
        self,
        endpoint: str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        around: Surroundings,
        on_loss: OnLoss,
        pace: Pace,
        watchdog_s: float,
        terms: Terms = USUAL,
    ) -> None:
        roster = RealTime(assignments, watchdog_s, timeout_s, on_loss, terms)
        super().__init__(endpoint, run_id, roster, timeout_s, clock, around)
        self._pace, self._assignments = pace, assignments

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES) -> Actions:
        """A frame to every runner; what has come when the tick is over."""
        self._send(self._roster.open_tick(tick, self._pace.begin(), senses, heard, outcomes))
        self._pace.hold(tick)
        self._take_in()
        return self._roster.take()

    def report(self) -> RealTimeReport:
        """How far loop and runners kept up."""
        roster, pace = self._roster, self._pace
        return RealTimeReport(
            factor=pace.factor,
            missed_ticks=pace.missed_ticks,
            worst_lag_s=to_s(pace.worst_lag_ns),
            late_answers=self._by_robot(roster.late),
            watchdog_stops=self._by_robot(roster.watchdog_stops),
            frames_dropped=roster.frames_dropped,
            packets_dropped=roster.packets_dropped,
            outcomes_dropped=roster.outcomes_dropped,
        )

    def _by_robot(self, counts: IntArray) -> dict[str, int]:
        """The counts that are not 0, by robot."""
        groups = [group for assignment in self._assignments for group in assignment.groups]
        pairs = [pair for group in groups for pair in zip(group.robot_names, counts[group.rows].tolist(), strict=True)]
        return {name: count for name, count in pairs if count}
