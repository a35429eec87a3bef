"""The loop: one tick, written once. What differs between modes is only the crew."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from swarmwire.comms.air.air import Air
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.events.event import Event
from swarmwire.comms.outcomes import NO_OUTCOMES
from swarmwire.comms.packets import NOWHERE, Heard, Sent
from swarmwire.comms.protocols import Crew, Observer
from swarmwire.comms.truth import Tally, Truth
from swarmwire.world.events import Events
from swarmwire.world.mailbox import Mailbox
from swarmwire.world.trajectory_hash import TrajectoryHash
from swarmwire.world.world import World


class Loop:
    """Drives world, air and crew through `ticks` ticks and shows each to the observers."""

    def __init__(
        self, world: World, air: Air | None, crew: Crew, observers: Sequence[Observer], events: Sequence[Event] = ()
    ) -> None:
        self.world, self.air, self.crew, self.observers = world, air, crew, observers
        self.ticks_done = 0
        self._events = Events(events, world.static, world.keys, air.radio if air else None)
        self._mailbox = Mailbox(world.static)
        self._lost: Counter[str] = Counter()  # packets that never came to the air, by why
        self._open: Tally | None = None  # of the tick under way: no observer has seen it yet
        self._hash = TrajectoryHash(world.static.arenas, world.static.robots)

    def run(
        self, ticks: int, stopped: Callable[[], bool] = lambda: False, hold: Callable[[int], None] = lambda _: None
    ) -> None:
        """Run up to tick `ticks`, or until `stopped()`; the crew must have been started.

        `hold` returns when the tick that it is given may begin; it changes when a tick begins, never what is in it.
        """
        while self.ticks_done < ticks:
            hold(self.ticks_done)
            if stopped():
                return
            self.step()

    def step(self) -> Truth:
        """One tick, in the order of the design: events, air, senses, crew, air, physics, observers."""
        world, tick = self.world, self.ticks_done
        start_ns = tick_start_ns(tick, world.static.rate_hz)
        events = self._events.apply(start_ns, world, self.air)
        news = self.air.advance(start_ns) if self.air else None
        heard = news.heard if news else Heard.none()
        self._open = news.tally if news else None
        senses = world.sense(tick)
        packets = self._mailbox.hand_over(tick, heard, world.alive)
        outcomes = self._mailbox.hand_over_outcomes(tick, news.outcomes if news else NO_OUTCOMES, world.alive)
        actions = self.crew.act(tick, senses, packets, outcomes)

        pose, velocity, movable, alive = world.pose, world.velocity, world.movable, world.alive.copy()
        if self.air:
            self.air.hold(pose, alive)
            self.air.send(start_ns, tick, self._addressable(actions.sent))
        elif len(actions.sent):
            self._lost["packets_without_radio"] += len(actions.sent)
        onsets = world.move(actions)
        command = world.command
        self._hash.add(pose, velocity, command, heard)
        edges = self.air.edges(pose, alive) if self.air else None
        tally, finished = (news.tally, news.finished) if news else (None, None)
        self._open = None
        truth = Truth(
            tick=tick,
            time_ns=start_ns,
            alive=alive,
            pose=pose,
            velocity=velocity,
            command=command,
            state=world.states.code,
            states=world.states.names,
            leds=world.actuators.leds.told,
            senses=senses,
            contact_onsets=onsets,
            edges=edges,
            tally=tally,
            finished=finished,
            events=events,
            departed=news.departed if news else None,
            movable=movable,
            value=world.values.value,
        )
        for observer in self.observers:
            observer.see(truth)
        self.ticks_done += 1
        return truth

    def end(self) -> Tally | None:
        """End the air: what was in flight, and what no observer has seen of a tick that was broken off."""
        if self.air is None:
            return None
        last = self.air.end()
        return last if self._open is None else last + self._open

    def hexdigests(self) -> list[str]:
        """`trajectory_sha256` of each arena so far."""
        return self._hash.hexdigests()

    def counts(self) -> dict[str, int]:
        """Faults on the way between agents and world so far, by name."""
        return {**self.crew.counts(), **self.world.counts(), **self._lost}

    def _addressable(self, sent: Sent) -> Sent:
        """Packets for a robot that is not there, or for the sender itself, are counted and go NOWHERE."""
        robots = self.world.static.robots
        nobody = (sent.to >= robots) | (sent.to == sent.sender % robots)
        if not nobody.any():
            return sent
        self._lost["packets_to_nobody"] += int(nobody.sum())
        return replace(sent, to=np.where(nobody, NOWHERE, sent.to))
