"""The remote crew in lockstep: the loop waits for every runner, as fast as the machine allows."""

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import Clock
from swarmwire.comms.packets import NO_OUTCOMES, Heard, Outcomes
from swarmwire.comms.tick_io import Actions, Senses
from swarmwire.world.crews.door import Door
from swarmwire.world.crews.lockstep import Lockstep
from swarmwire.world.crews.roster import OnLoss
from swarmwire.world.crews.runner_crew import START_S, RunnerCrew, Surroundings
from swarmwire.world.crews.terms import USUAL, Terms

ALONE = Surroundings()


class RemoteCrew(RunnerCrew[Lockstep]):
    """All agents of a run in runners; `lockstep` decides, this carries the bytes."""

    def __init__(
        self,
        door: Door | str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        around: Surroundings = ALONE,
        on_loss: OnLoss = "stop",
        start_s: float = START_S,
        terms: Terms = USUAL,
    ) -> None:
        super().__init__(door, run_id, Lockstep(assignments, on_loss, terms), timeout_s, clock, around, start_s)

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES) -> Actions:
        """One frame to every runner, one answer from each."""
        self._send(self._roster.open_tick(tick, senses, heard, outcomes))
        self._wait()
        return self._roster.take()
