"""The loop: the steps of one tick, the same in all modes; modes differ only in the agent backend.

`Loop.step` runs one tick. `Mailbox` stores packets and transmit statuses for robots that do not act in every tick.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import NO_PACKET, NOWHERE
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

ALWAYS_REPORTED = ("clipped_commands", "nan_commands")  # counts that are reported even if they are 0


class Mailbox:
    """The packets and transmit statuses of robots since their last step.

    If all robots act in every tick, it passes everything on without a copy.
    """

    def __init__(self, static: Static) -> None:
        self._act_every: IntArray = np.tile(static.act_every_ticks, static.arenas)  # (rows,)
        self._passes_on = bool((self._act_every == 1).all())
        self._packets = ReceivedPackets.none()
        self._tx_status = NO_TX_STATUSES

    def pop_packets(self, tick: int, received: ReceivedPackets, alive: BoolArray) -> ReceivedPackets:
        """Add the packets `received` since the last tick, and return the packets of the robots that act in this tick.

        Stored packets of a robot that is not `alive` (rows,) are lost.
        """
        if self._passes_on:
            return received
        pending = ReceivedPackets.joined([received, self._packets])
        acts = (tick % self._act_every == 0)[pending.receiver]
        self._packets = pending.select(np.flatnonzero(~acts & alive[pending.receiver])).compacted()
        return pending.select(np.flatnonzero(acts))

    def pop_tx_statuses(self, tick: int, tx_status: TxStatuses, alive: BoolArray) -> TxStatuses:
        """Add transmit statuses, and return those of the robots that act in this tick; see `pop_packets`."""
        if self._passes_on:
            return tx_status
        pending = TxStatuses.joined([self._tx_status, tx_status])
        acts = (tick % self._act_every == 0)[pending.row]
        self._tx_status = pending.select(np.flatnonzero(~acts & alive[pending.row]))
        return pending.select(np.flatnonzero(acts))


class TickInputs(NamedTuple):
    """The inputs of a tick's second part: events, receptions and readings."""

    tick: int
    start_ns: int
    effects: Effects
    results: Results | None  # results of the medium; None: no radio
    readings: Readings
    received: ReceivedPackets  # packets of the robots that act
    tx_status: TxStatuses

    def select_arenas(self, running: BoolArray, robots: int) -> "TickInputs":
        """Keep the inputs of the arenas that still run, `running` (arenas,), of `robots` robots each."""
        rows = np.repeat(running, robots)
        readings: Readings = {}
        for name, group in self.readings.items():
            index = np.flatnonzero(rows[group.rows])
            fields = {field: values[index] for field, values in group.fields.items()}
            readings[name] = replace(group, rows=group.rows[index], fields=fields)
        results = replace(self.results.in_arenas(running, robots), edges=self.results.edges) if self.results else None
        return self._replace(
            results=results,
            readings=readings,
            received=self.received.select(np.flatnonzero(rows[self.received.receiver])),
            tx_status=self.tx_status.select(np.flatnonzero(rows[self.tx_status.row])),
        )


class Loop:
    """Drives world, radio medium and agent backend through the ticks of a run, and shows each tick to the observers.

    An arena whose stop conditions hold leaves the world; its results are the same as in a run alone.

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
        external_events: Callable[[int, BoolArray], Sequence[EventRecord]] | None = None,
        *,
        hashes: bool = True,
    ) -> None:
        """Make a loop; the backend must be started before `run` is called.

        Args:
            world: the world.
            medium: the radio medium; None: the run has no radio.
            backend: the agents, called once in each tick.
            observers: called with the truth of each tick at its end.
            events: the scenario's events.
            stop_conditions: checked after each tick, after the observers; None: no arena ends before the run.
            live_events: live events, applied at the start of each tick.
            timed: the same object as `backend`, if it sends and delivers packets within a tick; else None.
            external_events: called with the start of a tick in ns and the robots that are alive (rows,); returns the
                records of events that come neither from the scenario nor from a live event.
            hashes: whether trajectories are hashed.
        """
        self.world, self.medium, self.backend, self.observers = world, medium, backend, observers
        self.ticks_done = 0
        self._stop_conditions = stop_conditions
        self._running, self._final_ticks = world.running.copy(), np.zeros(world.static.arenas, np.int64)
        self._live_events = live_events
        progress = live_events.progress if live_events else None
        self._events = EventScheduler(events, world.static, world.keys, medium.radio if medium else None, progress)
        self._mailbox = Mailbox(world.static)
        self._timed, self._external_events = timed, external_events
        self._subtick = SubtickRadio(medium, world.static, self._readdress_invalid) if medium and timed else None
        self._invalid_destination = np.zeros(world.static.arenas, np.int64)
        self._without_radio = np.zeros(world.static.arenas, np.int64)
        # What no observer has seen: results of a tick that has not ended, and counts of arenas that left.
        self._unseen: Results | None = None
        self._unseen_of_left: PacketCounts | None = None
        self._hash = TrajectoryHash(world.static.arenas, world.static.robots)
        if not hashes:
            self._hash.close(np.ones(world.static.arenas, np.bool_))

    def run(
        self, ticks: int, stopped: Callable[[], bool] = lambda: False, wait: Callable[[int], None] = lambda _: None
    ) -> None:
        """Run until `ticks` ticks are done in total, all arenas have ended, or `stopped()` is true.

        `wait` blocks until a tick may begin; it changes the start of a tick, never its content.
        """
        while self.ticks_done < ticks and self._running.any():
            wait(self.ticks_done)
            if stopped():
                return
            self.step()

    def step(self) -> Truth:
        """Run one tick: events, radio medium, sensors, backend, radio medium, physics, observers, stop conditions."""
        return self.end_tick(self.begin_tick())

    def begin_tick(self) -> TickInputs:
        """Run the first part of a tick, up to the agents' inputs: events, radio medium, sensors."""
        world, tick = self.world, self.ticks_done
        start_ns = tick_start_ns(tick, world.static.rate_hz)
        self._apply_live_events(tick, start_ns)
        effects = self._events.apply(start_ns, world)
        results, packets, tx_status = self._receive(start_ns, effects)
        readings = world.sense(tick)
        return TickInputs(tick, start_ns, effects, results, readings, packets, tx_status)

    def end_tick(self, inputs: TickInputs) -> Truth:
        """Run the second part of a tick: backend, radio medium, physics, observers, stop conditions."""
        world = self.world
        tick, start_ns, effects, results, readings, packets, tx_status = inputs
        actions = self._act(start_ns, readings, packets, tx_status)
        received = results.received if results else ReceivedPackets.none()
        pose, velocity, movable, alive = world.pose, world.velocity, world.movable, world.alive.copy()
        radio_pose = world.radio_pose
        onsets = world.move(actions)
        command = world.command
        self._hash.add(radio_pose if world.static.any_followed else pose, velocity, command, received)
        self._unseen = None
        events = effects.records
        if self._external_events:
            events = (*events, *self._external_events(start_ns, alive))
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
            leds=world.actuators.leds.published,
            readings=readings,
            contact_onsets=onsets,
            edges=results.edges if results else None,
            tally=results.tally if results else None,
            finished=results.finished if results else None,
            events=events,
            departed=results.departed if results else None,
            movable=movable,
            value=world.values.value,
            height_m=radio_pose[:, 3],
        )
        for observer in self.observers:
            observer.see(truth)
        self.ticks_done += 1
        done = self._stop_conditions.done() if self._stop_conditions else None
        if done is not None:
            self.leave(done)
        return truth

    def leave(self, done: BoolArray) -> None:
        """Remove the arenas `done` (arenas,) from all further ticks; see `TickInputs.select_arenas` within a tick."""
        done = done & self._running
        if not done.any():
            return
        self._running = self._running & ~done  # a new array: observers may keep the old array
        self._final_ticks[done] = self.ticks_done
        self._hash.close(done)
        self.world.leave(done)
        if self.medium:
            if self._subtick:
                self._subtick.leave(done)
                self._show_last(self.medium.unreported(), done)
            counts = self.medium.leave(done)
            self._unseen_of_left = counts if self._unseen_of_left is None else self._unseen_of_left + counts

    def end(self) -> PacketCounts | None:
        """End the medium, and return the counts of packets in flight and of packets that no observer has seen."""
        if self.medium is None:
            return None
        self._show_last(self._unseen, self._running)
        if self._subtick:
            self._subtick.end()
            self._show_last(self.medium.unreported(), self._running)
        last = self.medium.end()
        for counts in (self._unseen_of_left, self._unseen.tally if self._unseen else None):
            last = last if counts is None else last + counts
        return last

    def _show_last(self, results: Results | None, ended: BoolArray) -> None:
        """Show observers the packets of arenas `ended` (arenas,) among results that are in no truth."""
        if results is not None:
            last = results.in_arenas(ended, self.world.static.robots)
            for observer in self.observers:
                observer.see_last(last.departed, last.finished)

    @property
    def arena_ticks(self) -> IntArray:
        """Number of ticks of each arena, (arenas,)."""
        return np.where(self._running, self.ticks_done, self._final_ticks)

    def hexdigests(self) -> list[str]:
        """Return `trajectory_sha256` of each arena so far."""
        return self._hash.hexdigests()

    def counts(self) -> dict[str, int]:
        """Return the faults between agents and world so far, by name: those above 0, and ALWAYS_REPORTED."""
        totals = {name: int(counts.sum()) for name, counts in self._fault_counts().items()}
        return {
            **self.backend.counts(),
            **{name: count for name, count in totals.items() if count or name in ALWAYS_REPORTED},
        }

    def arena_counts(self) -> list[dict[str, int]]:
        """Return the faults of each arena, by name, those above 0."""
        faults = {name: counts.tolist() for name, counts in self._fault_counts().items()}
        arenas = range(self.world.static.arenas)
        return [{name: counts[arena] for name, counts in faults.items() if counts[arena]} for arena in arenas]

    def _fault_counts(self) -> dict[str, IntArray]:
        """Return the number of faults by name, (arenas,) each."""
        packets = {"packets_to_nobody": self._invalid_destination, "packets_without_radio": self._without_radio}
        return {**self.world.counts(), **packets}

    def _receive(self, start_ns: int, effects: Effects) -> tuple[Results | None, ReceivedPackets, TxStatuses]:
        """Return the results of the medium up to a tick's start, and the packets and statuses for the backend."""
        world, pose, tick = self.world, self.world.radio_pose, self.ticks_done
        if self.medium is None:
            return None, ReceivedPackets.none(), NO_TX_STATUSES
        if self._subtick:
            results, received, tx_status = self._subtick.step(start_ns, pose, effects.disruption, effects.radio)
            self._unseen = results
            return results, received, tx_status
        results = self.medium.step(start_ns, pose, effects.disruption, effects.radio)
        self._unseen = results
        packets = self._mailbox.pop_packets(tick, results.received, world.alive)
        tx_status = self._mailbox.pop_tx_statuses(tick, results.tx_status, world.alive)
        return results, packets, tx_status

    def _act(self, start_ns: int, readings: Readings, packets: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        """Return the actions of the robots in a tick, after sending their packets to the medium."""
        world, tick = self.world, self.ticks_done
        if self._timed and self._subtick:
            return self._timed.act_in_time(tick, readings, packets, tx_status, self._subtick)
        actions = self.backend.act(tick, readings, packets, tx_status)
        if self.medium:
            self.medium.send(start_ns, tick, self._readdress_invalid(actions.sent))
        elif len(actions.sent):
            np.add.at(self._without_radio, actions.sent.sender // world.static.robots, 1)
        return actions

    def _apply_live_events(self, tick: int, start_ns: int) -> None:
        """Begin and end the live events of this tick."""
        if self._live_events is None:
            return
        for number, event in self._live_events.pop_due(tick, self.world.static.rate_hz):
            if event is None:
                self._events.end(number, start_ns)
            else:
                self._events.begin(number, event, start_ns)

    def _readdress_invalid(self, sent: SentPackets) -> SentPackets:
        """Count packets to a robot that does not exist or to the sender itself, and readdress them to NOWHERE.

        The conditions are those of `first_without_receiver`. Handles of robots and decoders of frames refuse negative
        numbers other than BROADCAST before.
        """
        robots = self.world.static.robots
        if first_without_receiver(sent, robots) == NO_PACKET:
            return sent
        invalid = (sent.to < NOWHERE) | (sent.to >= robots) | (sent.to == sent.sender % robots)
        np.add.at(self._invalid_destination, sent.sender[invalid] // robots, 1)
        return replace(sent, to=np.where(invalid, NOWHERE, sent.to))
