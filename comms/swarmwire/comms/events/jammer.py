"""Jammer: noise that drowns what robots near it should hear."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.air.jammers import NO_ROBOT, Jammers
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter

PHASE = purpose("jammer phase")
LEAST_PERIOD_S = 10e-6  # less than a symbol of any radio here: noise that comes and goes so fast is constant noise


@dataclass(frozen=True, kw_only=True)
class Jammer(LastingEvent):
    """A jammer adds its power to the noise of every robot of its arena: frames drown, and the air counts as busy.

    It stands at a place, or robots carry it; who carries one is spared by it, and goes on carrying it when dead. Its
    power falls by the radio's own path loss, shadowing and walls. It is on for `duty` of each period, from a phase
    drawn for each jammer. A packet that would have been right without ends as `jammed`.
    """

    do: str = parameter("jammer", help="noise drowns what robots near it should hear", choices=("jammer",))
    at: tuple[float, float] | None = parameter(None, help="where it stands, in the arena's frame", unit="m")
    robots: Selection | None = parameter(None, help="who carry one each; share and count choose among robots alive")
    power_dbm: float = parameter(
        help="what it radiates, alike in all directions", unit="dBm", at_least=-100, at_most=100
    )
    duty: float = parameter(1.0, help="the share of time for which it is on", above=0, at_most=1)
    period_s: float = parameter(0.01, help="from one time that it goes on to the next", unit="s", above=0, at_most=1e6)
    needs_radio = needs_signals = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for neither or both of place and robots, or robots that there are not."""
        if (self.at is None) == (self.robots is None):
            raise BadInput("", "", "expected either at = [x, y] or robots")
        super().check(groups)
        if self.period_s < LEAST_PERIOD_S:
            raise BadInput("", "period_s", f"expected at least {LEAST_PERIOD_S:f} s, got {self.period_s!r}")

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput for a disk, or where nothing on air disturbs anything."""
        super().check_radio(radio)
        if radio.access_or_default.method == "none":
            raise BadInput("", "do", 'expected another radio.access.method than "none", with which nothing disturbs')

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Put them up."""
        if self.robots is None:
            arena = np.arange(len(swarm.keys))
            carrier = np.full(len(arena), NO_ROBOT)
        else:
            carrier = np.flatnonzero(self.robots.rows(serial, swarm, conditions.alive))
            arena = carrier // swarm.robots
        conditions.jammers[serial] = self._jammers(serial, swarm, arena, carrier)

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """Those who carry one, or all robots."""
        changed = np.full(conditions.rows, self.robots is None)
        if self.robots is not None:
            changed[conditions.jammers[serial].carrier] = True
        return changed

    def _jammers(self, serial: int, swarm: Swarm, arena: IntArray, carrier: IntArray) -> Jammers:
        k, period_ns = len(arena), to_ns(self.period_s)
        index = np.where(carrier == NO_ROBOT, swarm.robots, carrier % swarm.robots)
        u = uniform(swarm.keys[arena], index, serial, 0, PHASE)
        x_m, y_m = self.at or (0.0, 0.0)
        return Jammers(
            arena=arena,
            carrier=carrier,
            x_m=np.full(k, x_m),
            y_m=np.full(k, y_m),
            power_dbm=np.full(k, self.power_dbm),
            on_ns=np.full(k, max(round(self.duty * period_ns), 1)),
            period_ns=np.full(k, period_ns),
            phase_ns=(u * period_ns).astype(np.int64),
        )
