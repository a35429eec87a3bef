"""Events that act on radios: blackout, antenna gain, jammer, and ramp of a radio parameter."""

from dataclasses import dataclass, replace

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.config.checks import check_radio
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import ParameterRamp, check_number, radio_at
from swarmwire.comms.radio.disruption import BACKLOGS, Jammers
from swarmwire.world.events.effects import ActiveEffects, exclusive
from swarmwire.world.events.event import LastingEvent
from swarmwire.world.events.selection import Groups, Selection, Swarm

PHASE_PURPOSE = purpose("jammer phase")
MIN_PERIOD_S = 10e-6  # shorter periods are below a symbol of any radio, and so constant noise


@dataclass(frozen=True, kw_only=True)
class Blackout(LastingEvent):
    """Radios neither send nor receive; the robots' agents continue without a notice.

    Packets sent meanwhile are dropped, unless `backlog` keeps them in the queue until the radio is on again. Then they
    go on air one after the other. Where blackouts overlap, the strictest backlog applies.
    """

    do: str = parameter("blackout", help="radios neither send nor receive", choices=("blackout",))
    robots: Selection = parameter(help="whose radios; share and count choose among robots alive")
    backlog: str = parameter(
        "drop",
        help="packets meanwhile: end at the usual pace, only the newest waits, or all do up to queue_limit",
        choices=BACKLOGS,
    )
    needs_radio = True

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Switch the radios off."""
        effects.backlogs[serial] = BACKLOGS.index(self.backlog)
        effects.blackouts[serial] = self.robots.rows(serial, swarm, effects.alive)

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for robots whose radios no other blackout switches off."""
        return exclusive(serial, effects.blackouts)


@dataclass(frozen=True, kw_only=True)
class Gain(LastingEvent):
    """The antenna gain of robots changes, separately for sending and receiving; gains of several events add up.

    A robot with a lower `receive_db` alone is received as before, but receives less: its links are asymmetric.
    """

    do: str = parameter("gain", help="antennas send or hear better or worse", choices=("gain",))
    robots: Selection = parameter(help="whose antennas; share and count choose among robots alive")
    send_db: float = parameter(
        0.0, help="added to the strength of all that they send", unit="dB", at_least=-200, at_most=100
    )
    receive_db: float = parameter(
        0.0, help="added to the strength of all that they hear", unit="dB", at_least=-200, at_most=100
    )
    needs_radio = needs_phy = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for unknown robots, or if nothing would change."""
        super().check(groups)
        if self.send_db == 0.0 and self.receive_db == 0.0:
            raise BadInput("", "", "expected send_db or receive_db")

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Change the antennas."""
        chosen = self.robots.rows(serial, swarm, effects.alive)
        effects.gains[serial] = np.where(chosen, np.array([[self.send_db], [self.receive_db]]), 0.0)

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for all chosen robots."""
        return (effects.gains[serial] != 0.0).any(axis=0)


@dataclass(frozen=True, kw_only=True)
class Jammer(LastingEvent):
    """A jammer adds its power to the noise of every robot of its arena: frames are lost, and the channel is busy.

    It stands at a point, or robots carry it, also when dead; a jammer does not affect its carrier. Its power falls by
    the radio's path loss, shadowing and walls. It is on for `duty` of each period, from a phase drawn for each jammer.
    A packet that would have been received without it ends as `jammed`.
    """

    do: str = parameter("jammer", help="noise hides packets from receivers near it", choices=("jammer",))
    at: tuple[float, float] | None = parameter(None, help="where it stands, in the arena's frame", unit="m")
    robots: Selection | None = parameter(
        None, help="robots with a jammer each; share and count choose among robots alive"
    )
    power_dbm: float = parameter(
        help="radiated power, the same in all directions", unit="dBm", at_least=-100, at_most=100
    )
    duty: float = parameter(1.0, help="the share of time for which it is on", above=0, at_most=1)
    period_s: float = parameter(0.01, help="time between two starts of a transmission", unit="s", above=0, at_most=1e6)
    needs_radio = needs_phy = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput unless either `at` or `robots` is set, or for unknown robots."""
        if (self.at is None) == (self.robots is None):
            raise BadInput("", "", "expected either at = [x, y] or robots")
        super().check(groups)
        if self.period_s < MIN_PERIOD_S:
            raise BadInput("", "period_s", f"expected at least {MIN_PERIOD_S:f} s, got {self.period_s!r}")

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput for a unit disk, or a radio whose frames do not interfere."""
        super().check_radio(radio)
        if radio.access_or_default.method == "none":
            raise BadInput("", "do", 'expected another radio.access.method than "none", which ignores noise')

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Place the jammers."""
        if self.robots is None:
            arena = np.arange(len(swarm.keys))
            carrier = np.full(len(arena), NO_ROBOT)
        else:
            carrier = np.flatnonzero(self.robots.rows(serial, swarm, effects.alive))
            arena = carrier // swarm.robots
        effects.jammers[serial] = self._jammers(serial, swarm, arena, carrier)

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for the carriers; for all robots if the jammer stands at a point."""
        changed = np.full(effects.rows, self.robots is None)
        if self.robots is not None:
            changed[effects.jammers[serial].carrier] = True
        return changed

    def _jammers(self, serial: int, swarm: Swarm, arena: IntArray, carrier: IntArray) -> Jammers:
        jammers, period_ns = len(arena), to_ns(self.period_s)
        index = np.where(carrier == NO_ROBOT, swarm.robots, carrier % swarm.robots)
        u = uniform(swarm.keys[arena], index, serial, 0, PHASE_PURPOSE)
        x_m, y_m = self.at or (0.0, 0.0)
        return Jammers(
            arena=arena,
            carrier=carrier,
            x_m=np.full(jammers, x_m),
            y_m=np.full(jammers, y_m),
            power_dbm=np.full(jammers, self.power_dbm),
            on_ns=np.full(jammers, max(round(self.duty * period_ns), 1)),
            period_ns=np.full(jammers, period_ns),
            phase_ns=(u * period_ns).astype(np.int64),
        )


@dataclass(frozen=True, kw_only=True)
class Ramp(LastingEvent):
    """A number of `[radio]` moves linearly to `to`, tick by tick, and stays there; undone, it returns at once.

    Any number that the scenario or its preset sets, except `send_offset`, which is constant during a run. Powers and
    gains of groups do not change; bursts that are defined by steps change by `bad_s` and `good_s`. Packets that wait or
    are on air are not affected: their airtime and limits are those of the time at which they were sent. A ramp starts
    at the value that earlier ramps have reached.
    """

    do: str = parameter("ramp", help="a number of the radio moves to another value", choices=("ramp",))
    what: str = parameter(help='the key of the number, such as "radio.loss" or "radio.bursts.bad_s"')
    to: float = parameter(help="final value, in the key's unit and bounds; whole numbers are rounded on the way")
    over_s: float = parameter(0.0, help="duration of the ramp; 0: a step", unit="s", at_least=0, at_most=1e9)
    needs_radio = True

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput if `what` is no number of this radio, or the values contradict its other keys."""
        check_number(radio, self.what, self.to)
        ramp = replace(self._parameter_ramp(), start_ns=0)
        # Some keys take only certain values, which may lie at the end of the way but not along it.
        for key, at_ns in (("to", ramp.duration_ns), ("over_s", ramp.duration_ns // 2)):
            try:
                check_radio(radio_at(radio, [ramp], at_ns), "")
            except BadInput as error:
                raise BadInput("", key, f"{error.key}: {error.expected}") from None

    def apply(self, serial: int, swarm: Swarm, effects: ActiveEffects) -> None:
        """Start the ramp."""
        effects.ramps[serial] = self._parameter_ramp()

    def changed(self, serial: int, effects: ActiveEffects) -> BoolArray:
        """True for all robots."""
        return np.ones(effects.rows, np.bool_)

    def _parameter_ramp(self) -> ParameterRamp:
        return ParameterRamp(self.what, self.to, to_ns(self.at_s), to_ns(self.over_s))
