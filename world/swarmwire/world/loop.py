"""The mailbox: packets, and tx statuses of packets, wait here for robots that do not act in every tick."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.events.event import Event
from swarmwire.comms.interfaces import AgentBackend, Observer, StopConditions, TimedBackend
from swarmwire.comms.packets import NO_TX_STATUSES, NOWHERE, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.results import Results
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.world.event_scheduler import EventScheduler
from swarmwire.world.live_events import LiveEvents
from swarmwire.world.subtick import SubtickRadio
from swarmwire.world.trajectory_hash import TrajectoryHash
from swarmwire.world.world import World


class Mailbox:
    """What robots received, and learned of their packets, since they last acted.

    Where all act in every tick it passes everything on at no cost.
    """

    def __init__(self, static: Static) -> None:
        self._every: IntArray = np.tile(static.act_every_ticks, static.arenas)  # (rows,)
        self._always = bool((self._every == 1).all())
        self._waiting = ReceivedPackets.none()
        self._tx_status = NO_TX_STATUSES

    def hand_over(self, tick: int, received: ReceivedPackets, alive: BoolArray) -> ReceivedPackets:
        """All that waits for the robots that act in this tick, with what they `received` since the last tick.

        What waits for a robot that is not `alive` (rows,) is lost with it.
        """
        if self._always:
            return received
        here = received.merged(self._waiting) if len(self._waiting) else received
        acts = (tick % self._every == 0)[here.receiver]
        self._waiting = here.select(np.flatnonzero(~acts & alive[here.receiver])).compacted()
        return here.select(np.flatnonzero(acts))

    def hand_over_tx_status(self, tick: int, tx_status: TxStatuses, alive: BoolArray) -> TxStatuses:
        """The same of `tx_status`; `alive` is (rows,)."""
        if self._always:
            return tx_status
        here = TxStatuses.joined([self._tx_status, tx_status])
        acts = (tick % self._every == 0)[here.row]
        self._tx_status = here.select(np.flatnonzero(~acts & alive[here.row]))
        return here.select(np.flatnonzero(acts))


# --- The loop: one tick, written once. What differs between modes is only the backend.


ALWAYS_TOLD = ("clipped_commands", "nan_commands")


class Loop:
    """Drives world, air and backend through `ticks` ticks and shows each to the observers.

    An arena that its judge finds over leaves the world: what it came to is what it would have come to alone.

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
        interventions: LiveEvents | None = None,
        timed: TimedBackend | None = None,
    ) -> None:
        """`stop_conditions` are asked after each tick, once observers saw it; without them none ends before the run.

        `interventions` are asked at the start of each tick for events that people want. `timed` is the backend, if it
        is to put packets on air and hand them over while a tick goes on.
        """
        self.world, self.medium, self.backend, self.observers = world, medium, backend, observers
        self.ticks_done = 0
        self._stop_conditions = stop_conditions
        self._running, self._left_after = world.running.copy(), np.zeros(world.static.arenas, np.int64)
        self._interventions = interventions
        course = interventions.course if interventions else None
        self._events = EventScheduler(events, world.static, world.keys, medium.radio if medium else None, course)
        self._mailbox = Mailbox(world.static)
        self._timed = timed
        self._in_time = SubtickRadio(medium, world.static, self._addressable) if medium and timed else None
        self._to_nobody, self._without_radio = np.zeros_like(self._left_after), np.zeros_like(self._left_after)
        self._open: PacketCounts | None = None  # of the tick under way: no observer has seen it yet
        self._stranded: PacketCounts | None = None  # in arenas that left: no observer has seen that they did
        self._hash = TrajectoryHash(world.static.arenas, world.static.robots)

    def run(
        self, ticks: int, stopped: Callable[[], bool] = lambda: False, hold: Callable[[int], None] = lambda _: None
    ) -> None:
        """Run up to tick `ticks`, until all arenas are over, or until `stopped()`; the backend must have been started.

        `hold` returns when the tick that it is given may begin; it changes when a tick begins, never what is in it.
        """
        while self.ticks_done < ticks and self._running.any():
            hold(self.ticks_done)
            if stopped():
                return
            self.step()

    def step(self) -> Truth:
        """One tick, in the order of the design: events, air, senses, backend, air, physics, observers, judge."""
        world, tick = self.world, self.ticks_done
        start_ns = tick_start_ns(tick, world.static.rate_hz)
        self._intervene(tick, start_ns)
        events = self._events.apply(start_ns, world, self.medium)
        news, packets, tx_status = self._receive(start_ns)
        readings = world.sense(tick)
        actions = self._act(start_ns, readings, packets, tx_status)
        received = news.received if news else ReceivedPackets.none()
        pose, velocity, movable, alive = world.pose, world.velocity, world.movable, world.alive.copy()
        onsets = world.move(actions)
        command = world.command
        self._hash.add(pose, velocity, command, received)
        edges = self.medium.edges(pose, alive) if self.medium else None
        tally, finished = (news.tally, news.finished) if news else (None, None)
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
        over = self._stop_conditions.done() if self._stop_conditions else None
        if over is not None:
            self._leave(over & self._running)
        return truth

    def end(self) -> PacketCounts | None:
        """End the medium: what was in flight, and what no observer has seen of a tick that was broken off."""
        if self.medium is None:
            return None
        if self._in_time:
            self._in_time.end()
        last = self.medium.end()
        for more in (self._stranded, self._open):
            last = last if more is None else last + more
        return last

    @property
    def arena_ticks(self) -> IntArray:
        """Ticks that each arena took part in, (arenas,)."""
        return np.where(self._running, self.ticks_done, self._left_after)

    def hexdigests(self) -> list[str]:
        """`trajectory_sha256` of each arena so far."""
        return self._hash.hexdigests()

    def counts(self) -> dict[str, int]:
        """Faults on the way between agents and world so far, by name; what is always told also where there is none."""
        told = {name: int(counted.sum()) for name, counted in self._counted().items()}
        return {
            **self.backend.counts(),
            **{name: count for name, count in told.items() if count or name in ALWAYS_TOLD},
        }

    def arena_counts(self) -> list[dict[str, int]]:
        """Those of them that belong to an arena, of each: by name, where there is any."""
        counted = {name: counts.tolist() for name, counts in self._counted().items()}
        arenas = range(self.world.static.arenas)
        return [{name: counts[arena] for name, counts in counted.items() if counts[arena]} for arena in arenas]

    def _counted(self) -> dict[str, IntArray]:
        """Faults by name, (arenas,) each."""
        packets = {"packets_to_nobody": self._to_nobody, "packets_without_radio": self._without_radio}
        return {**self.world.counts(), **packets}

    def _receive(self, start_ns: int) -> tuple[Results | None, ReceivedPackets, TxStatuses]:
        """What came of the radio up to a tick's start; of that, what the backend is to be told."""
        if self._in_time:
            news, packets, tx_status = self._in_time.begin(start_ns)
            self._open = news.tally
            return news, packets, tx_status
        tick, alive = self.ticks_done, self.world.alive
        news = self.medium.advance(start_ns) if self.medium else None
        self._open = news.tally if news else None
        packets = self._mailbox.hand_over(tick, news.received if news else ReceivedPackets.none(), alive)
        tx_status = self._mailbox.hand_over_tx_status(tick, news.tx_status if news else NO_TX_STATUSES, alive)
        return news, packets, tx_status

    def _act(self, start_ns: int, readings: Readings, packets: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        """What the robots do in a tick; what they send is the medium's."""
        world, tick = self.world, self.ticks_done
        if self.medium:
            self.medium.hold(world.pose, world.alive.copy())
        if self._timed and self._in_time:
            return self._timed.act_in_time(tick, readings, packets, tx_status, self._in_time)
        actions = self.backend.act(tick, readings, packets, tx_status)
        if self.medium:
            self.medium.send(start_ns, tick, self._addressable(actions.sent))
        elif len(actions.sent):
            np.add.at(self._without_radio, actions.sent.sender // world.static.robots, 1)
        return actions

    def _intervene(self, tick: int, start_ns: int) -> None:
        """Have begin and end what people want of this tick."""
        if self._interventions is None:
            return
        for number, event in self._interventions.take(tick, self.world.static.rate_hz):
            if event is None:
                self._events.end(number, start_ns)
            else:
                self._events.begin(number, event, start_ns)

    def _leave(self, over: BoolArray) -> None:
        """These arenas (arenas,) take no part in the ticks to come."""
        if not over.any():
            return
        self._running = self._running & ~over  # observers may keep what they were shown
        self._left_after[over] = self.ticks_done
        self._hash.close(over)
        self.world.leave(over)
        if self.medium:
            if self._in_time:
                self._in_time.leave(over)
            stranded = self.medium.leave(over)
            self._stranded = stranded if self._stranded is None else self._stranded + stranded

    def _addressable(self, sent: SentPackets) -> SentPackets:
        """Packets for a robot that is not there, or for the sender itself, are counted and go NOWHERE."""
        robots = self.world.static.robots
        nobody = (sent.to >= robots) | (sent.to == sent.sender % robots)
        if not nobody.any():
            return sent
        np.add.at(self._to_nobody, sent.sender[nobody] // robots, 1)
        return replace(sent, to=np.where(nobody, NOWHERE, sent.to))
