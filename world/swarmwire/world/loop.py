"""The loop: the steps of one tick, the same in all modes; modes differ only in the agent backend.

`Loop.step` is one tick. `Mailbox` keeps packets and transmit statuses for robots that do not act in every tick.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import NOWHERE
from swarmwire.comms.observe.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.results import Results
from swarmwire.comms.radio.transmissions import first_without_receiver
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.world.event_scheduler import Effects, EventScheduler
from swarmwire.world.events.event import Event
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.subtick import SubtickRadio
from swarmwire.world.trajectory_hash import TrajectoryHash
from swarmwire.world.world import World

ALWAYS_REPORTED = ("clipped_commands", "nan_commands")  # counts that are reported also if they are 0


class Mailbox:
    """The packets and transmit statuses that robots got since they last acted.

    If all robots act in every tick, it passes everything on at no cost.
    """

    def __init__(self, static: Static) -> None:
        self._act_every: IntArray = np.tile(static.act_every_ticks, static.arenas)  # (rows,)
        self._always = bool((self._act_every == 1).all())
        self._waiting = ReceivedPackets.none()
        self._tx_status = NO_TX_STATUSES

    def hand_over(self, tick: int, received: ReceivedPackets, alive: BoolArray) -> ReceivedPackets:
        """The waiting packets of the robots that act in this tick, with those `received` since the last tick.

        The waiting packets of a robot that is not `alive` (rows,) are lost.
        """
        if self._always:
            return received
        pending = ReceivedPackets.joined([received, self._waiting])
        acts = (tick % self._act_every == 0)[pending.receiver]
        self._waiting = pending.select(np.flatnonzero(~acts & alive[pending.receiver])).compacted()
        return pending.select(np.flatnonzero(acts))

    def hand_over_tx_status(self, tick: int, tx_status: TxStatuses, alive: BoolArray) -> TxStatuses:
        """As `hand_over`, for transmit statuses; `alive` is (rows,)."""
        if self._always:
            return tx_status
        pending = TxStatuses.joined([self._tx_status, tx_status])
        acts = (tick % self._act_every == 0)[pending.row]
        self._tx_status = pending.select(np.flatnonzero(~acts & alive[pending.row]))
        return pending.select(np.flatnonzero(acts))


class TickInputs(NamedTuple):
    """What a tick brings before its agents act."""

    tick: int
    start_ns: int
    effects: Effects
    results: Results | None  # of the medium; None: no radio
    readings: Readings
    received: ReceivedPackets  # by the robots that act
    tx_status: TxStatuses

    def of(self, running: BoolArray, robots: int) -> "TickInputs":
        """What concerns arenas `running` (arenas,), of `robots` robots each: some may leave in the middle of a tick."""
        rows = np.repeat(running, robots)
        readings: Readings = {}
        for name, group in self.readings.items():
            here = np.flatnonzero(rows[group.rows])
            fields = {field: values[here] for field, values in group.fields.items()}
            readings[name] = replace(group, rows=group.rows[here], fields=fields)
        kept = replace(self.results.in_arenas(running, robots), edges=self.results.edges) if self.results else None
        return self._replace(
            results=kept,
            readings=readings,
            received=self.received.select(np.flatnonzero(rows[self.received.receiver])),
            tx_status=self.tx_status.select(np.flatnonzero(rows[self.tx_status.row])),
        )


class Loop:
    """Drives world, radio medium and agent backend through the ticks of a run, and shows each tick to the observers.

    An arena whose stop conditions hold leaves the world; its results are those that it would have alone.

    Attributes:
        ticks_done: ticks so far.
    """

    def __init__(
        self,
        world: World,
        medium: RadioMedium | None,
        backend: AgentBackend,
        observers: Sequence[Observer],
        events: Sequence[Event] = (),
        stop_conditions: StopConditions | None = None,
        live_events: LiveEvents | None = None,
        timed: TimedBackend | None = None,
        follow: Callable[[int, BoolArray], Sequence[EventRecord]] | None = None,
        *,
        hashes: bool = True,
    ) -> None:
        """Make a loop for a backend that has been started before `run`.

        Args:
            world: the world.
            medium: the radio medium; None: the run has no radio.
            backend: the agents.
            observers: they see each tick at its end.
            events: the scenario's events.
            stop_conditions: checked after each tick, after the observers; None: no arena ends before the run.
            live_events: live events, taken at the start of each tick.
            timed: the backend, if it sends and delivers packets within a tick.
            follow: gets the start of each tick in ns and which robots are alive (rows,), and returns further events.
            hashes: whether trajectories are hashed.
        """
        self.world, self.medium, self.backend, self.observers = world, medium, backend, observers
        self.ticks_done = 0
        self._stop_conditions = stop_conditions
        self._running, self._left_after = world.running.copy(), np.zeros(world.static.arenas, np.int64)
        self._live_events = live_events
        progress = live_events.progress if live_events else None
        self._events = EventScheduler(events, world.static, world.keys, medium.radio if medium else None, progress)
        self._mailbox = Mailbox(world.static)
        self._timed, self._follow = timed, follow
        self._subtick = SubtickRadio(medium, world.static, self._addressable) if medium and timed else None
        self._invalid_destination, self._without_radio = (
            np.zeros_like(self._left_after),
            np.zeros_like(self._left_after),
        )
        self._open: PacketCounts | None = None  # of the open tick: no observer has seen it yet
        self._stranded: PacketCounts | None = None  # of arenas that left: no observer has seen these
        self._hash = TrajectoryHash(world.static.arenas, world.static.robots)
        if not hashes:
            self._hash.close(np.ones(world.static.arenas, np.bool_))

    def run(
        self, ticks: int, stopped: Callable[[], bool] = lambda: False, hold: Callable[[int], None] = lambda _: None
    ) -> None:
        """Run up to tick `ticks`, until all arenas are over, or until `stopped()`; the backend must have been started.

        `hold` blocks until a tick may begin; it changes the start of a tick, never its content.
        """
        while self.ticks_done < ticks and self._running.any():
            hold(self.ticks_done)
            if stopped():
                return
            self.step()

    def step(self) -> Truth:
        """One tick: events, radio medium, sensors, backend, radio medium, physics, observers, stop conditions."""
        return self.end_tick(self.begin_tick())

    def begin_tick(self) -> TickInputs:
        """The first part of a tick, up to what the agents get: events, radio medium, sensors."""
        world, tick = self.world, self.ticks_done
        start_ns = tick_start_ns(tick, world.static.rate_hz)
        self._apply_live_events(tick, start_ns)
        effects = self._events.apply(start_ns, world)
        results, packets, tx_status = self._receive(start_ns, effects)
        readings = world.sense(tick)
        return TickInputs(tick, start_ns, effects, results, readings, packets, tx_status)

    def end_tick(self, inputs: TickInputs) -> Truth:
        """The rest of the tick: backend, radio medium, physics, observers, stop conditions."""
        world = self.world
        tick, start_ns, effects, results, readings, packets, tx_status = inputs
        actions = self._act(start_ns, readings, packets, tx_status)
        received = results.received if results else ReceivedPackets.none()
        pose, velocity, movable, alive = world.pose, world.velocity, world.movable, world.alive.copy()
        onsets = world.move(actions)
        command = world.command
        self._hash.add(pose, velocity, command, received)
        self._open = None
        truth = Truth(
            tick=tick,
            time_ns=start_ns,
            running=self._running,
            alive=alive,
            pose=pose,
            velocity=velocity,
            command=command,
            state=world.states.code,
            states=world.states.names,
            leds=world.actuators.leds.told,
            readings=readings,
            contact_onsets=onsets,
            edges=results.edges if results else None,
            tally=results.tally if results else None,
            finished=results.finished if results else None,
            events=(*effects.records, *self._follow(start_ns, alive)) if self._follow else effects.records,
            departed=results.departed if results else None,
            movable=movable,
            value=world.values.value,
        )
        for observer in self.observers:
            observer.see(truth)
        self.ticks_done += 1
        done = self._stop_conditions.done() if self._stop_conditions else None
        if done is not None:
            self.leave(done)
        return truth

    def leave(self, done: BoolArray) -> None:
        """Remove these arenas (arenas,) from the ticks to come; from one that has begun, `TickInputs.of` does."""
        done = done & self._running
        if not done.any():
            return
        self._running = self._running & ~done  # a new array: observers may keep the old one
        self._left_after[done] = self.ticks_done
        self._hash.close(done)
        self.world.leave(done)
        if self.medium:
            if self._subtick:
                self._subtick.leave(done)
            stranded = self.medium.leave(done)
            self._stranded = stranded if self._stranded is None else self._stranded + stranded

    def end(self) -> PacketCounts | None:
        """End the medium: the counts of packets in flight, and those of a broken-off tick that no observer has seen."""
        if self.medium is None:
            return None
        if self._subtick:
            self._subtick.end()
        last = self.medium.end()
        for counts in (self._stranded, self._open):
            last = last if counts is None else last + counts
        return last

    @property
    def arena_ticks(self) -> IntArray:
        """The number of ticks of each arena, (arenas,)."""
        return np.where(self._running, self.ticks_done, self._left_after)

    def hexdigests(self) -> list[str]:
        """`trajectory_sha256` of each arena so far."""
        return self._hash.hexdigests()

    def counts(self) -> dict[str, int]:
        """Faults between agents and world so far, by name: those above 0, and ALWAYS_REPORTED."""
        totals = {name: int(counted.sum()) for name, counted in self._counted().items()}
        return {
            **self.backend.counts(),
            **{name: count for name, count in totals.items() if count or name in ALWAYS_REPORTED},
        }

    def arena_counts(self) -> list[dict[str, int]]:
        """The faults of each arena, by name, those above 0."""
        counted = {name: counts.tolist() for name, counts in self._counted().items()}
        arenas = range(self.world.static.arenas)
        return [{name: counts[arena] for name, counts in counted.items() if counts[arena]} for arena in arenas]

    def _counted(self) -> dict[str, IntArray]:
        """Faults by name, (arenas,) each."""
        packets = {"packets_to_nobody": self._invalid_destination, "packets_without_radio": self._without_radio}
        return {**self.world.counts(), **packets}

    def _receive(self, start_ns: int, effects: Effects) -> tuple[Results | None, ReceivedPackets, TxStatuses]:
        """The results of the medium up to a tick's start, and the packets and statuses for the backend."""
        world, tick = self.world, self.ticks_done
        if self.medium is None:
            return None, ReceivedPackets.none(), NO_TX_STATUSES
        if self._subtick:
            results, received, tx_status = self._subtick.step(start_ns, world.pose, effects.disruption, effects.radio)
            self._open = results.tally
            return results, received, tx_status
        results = self.medium.step(start_ns, world.pose, effects.disruption, effects.radio)
        self._open = results.tally
        packets = self._mailbox.hand_over(tick, results.received, world.alive)
        tx_status = self._mailbox.hand_over_tx_status(tick, results.tx_status, world.alive)
        return results, packets, tx_status

    def _act(self, start_ns: int, readings: Readings, packets: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        """The actions of the robots in a tick; their packets go to the medium."""
        world, tick = self.world, self.ticks_done
        if self._timed and self._subtick:
            return self._timed.act_in_time(tick, readings, packets, tx_status, self._subtick)
        actions = self.backend.act(tick, readings, packets, tx_status)
        if self.medium:
            self.medium.send(start_ns, tick, self._addressable(actions.sent))
        elif len(actions.sent):
            np.add.at(self._without_radio, actions.sent.sender // world.static.robots, 1)
        return actions

    def _apply_live_events(self, tick: int, start_ns: int) -> None:
        """Begin and end the live events of this tick."""
        if self._live_events is None:
            return
        for number, event in self._live_events.take(tick, self.world.static.rate_hz):
            if event is None:
                self._events.end(number, start_ns)
            else:
                self._events.begin(number, event, start_ns)

    def _addressable(self, sent: SentPackets) -> SentPackets:
        """Count packets to a robot that does not exist or to the sender itself, and send them NOWHERE."""
        robots = self.world.static.robots
        if first_without_receiver(sent, robots) < 0:
            return sent
        invalid = (sent.to >= robots) | (sent.to == sent.sender % robots)
        np.add.at(self._invalid_destination, sent.sender[invalid] // robots, 1)
        return replace(sent, to=np.where(invalid, NOWHERE, sent.to))
