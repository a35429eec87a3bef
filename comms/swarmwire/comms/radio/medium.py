"""The radio medium as a state machine: packets and poses go in, time passes, and received packets come out.

It does no I/O and reads no clock. `RadioMedium` drives a radio model (unit disk or PHY), keeps links until their fate
is final, and counts the fates.
"""

from functools import partial, reduce
from operator import add

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.sentinels import NO_PACKET, NO_ROBOT
from swarmwire.comms.radio import results
from swarmwire.comms.radio.config.checks import unfit_for_torus
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext, in_space
from swarmwire.comms.radio.counters import PacketCounters
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import RECEIVED, Links, keep_link_order
from swarmwire.comms.radio.liveness import Liveness
from swarmwire.comms.radio.model import RadioModel
from swarmwire.comms.radio.phy.model import SinrPhy
from swarmwire.comms.radio.positions import poses_between
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.results import Results
from swarmwire.comms.radio.send_times import SendTimes
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.radio.unit_disk.model import UnitDisk
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, ReceivedPackets, SentPackets, TxStatuses

# From this number of open links on, `advance` also removes final ones, since it reads all rows.
MANY_LINKS = 4096


def _check(context: ChannelContext) -> None:
    """Raise ValueError for a radio that lacks what its model needs, or that does not fit the boundary."""
    radio = context.radio
    if not radio.is_phy and radio.range_m is None:
        raise ValueError("range_m: expected a range, as a unit disk has one")
    if (radio.trace is None) != (context.traces is None):
        raise ValueError("traces: expected the content of the radio's trace file, and None without one")
    if context.is_torus and (unfit := unfit_for_torus(radio)) is not None:
        raise ValueError(f"{unfit}: expected a unit disk without bodies_block on a torus")


class RadioMedium:
    """The emulated medium of every arena of a world; robot row r is robot r % robots of arena r // robots.

    `radio` holds the current parameters.

    A packet waits in its sender's queue, goes on air, and ends at each intended receiver in exactly one fate. Each tick
    is a `step` to its start, then a `send`. So a packet sent in a tick is received in the next tick at the earliest,
    under the poses of the tick in which it goes on air, or between these and the next ones if the radio's positions are
    interpolated. `advance`, `send_at` and `set_poses` divide a tick into sub-ticks.

    A fate becomes final

    - RECEIVED: at the end of the airtime plus all delays of the link (trace, latency and jitter, distribution,
      propagation); with `keep_order` not before earlier packets of the link. A disruption that ends a reception changes
      the fate, not this time.
    - Any other fate of a packet on air: at the end of its airtime. A unicast packet with acknowledgements: at the end
      of its last attempt, mostly an ACK timeout; OUT_OF_RANGE at the end of the last airtime.
    - A fate at the sender's radio: when the radio drops the packet.

    Disruptions kill or revive robots, switch radios and set partitions at the start of a tick. Packets already on air
    stay on air, but dead robots receive nothing and their queues end. A radio that is off loses the packets that it is
    receiving; packets to send end or wait by its `backlog`. A revived robot receives only packets sent from then on.
    """

    def __init__(
        self, context: ChannelContext, rate_hz: int, act_every_ticks: IntArray | None = None, *, graph: bool = True
    ) -> None:
        """Create a medium in which no packet is under way.

        Args:
            context: the radio, the arenas and the robots; no other medium may have it.
            rate_hz: ticks per second.
            act_every_ticks: period in which each robot index acts, in ticks, (robots,); 1 each by default.
            graph: False leaves the edges out of the results, which takes less time.

        Raises:
            ValueError: a unit disk without `range_m`, a trace without its file or the other way round, or a radio that
                `unfit_for_torus` refuses on a torus.
        """
        _check(context)
        radio = context.radio
        self.radio, self._robots, self._rows, self._computes_graph = radio, context.robots, context.rows, graph
        self._liveness, self._threads = Liveness(context), context.threads
        period_ticks = np.ones(context.robots, np.int64) if act_every_ticks is None else act_every_ticks
        self._send_times = SendTimes(radio.send_offset, context.keys, period_ticks, rate_hz)
        self._packets, self._links = Transmissions(), Links()
        self._model: RadioModel = (SinrPhy if radio.is_phy else UnitDisk)(context, self._packets, self._links)
        self._counters = PacketCounters(len(context.keys), context.robots)
        self._now_ns, self._wrap_m = 0, context.wrap_m
        self._pose: FloatArray | None = None  # the poses of the last step
        self._parts: list[Results] = []  # results within the current tick
        self._tx_status: list[TxStatuses] = []  # statuses of the current tick that `advance` returned
        self._reported_ns = 0  # `advance` has returned the receptions up to then
        self._next_ns = NEVER_NS  # time of the next reception for `advance`; 0: unknown, NEVER_NS: none
        self._measures = radio.measures.columns
        self._nothing = ReceivedPackets.none(self._measures)

    def step(
        self, start_ns: int, pose: FloatArray, disruption: Disruption | None = None, radio: Radio | None = None
    ) -> Results:
        """Let time pass to the start of a tick, then apply `pose`, `disruption` and `radio`.

        Packets go on air before `start_ns` under the poses until then, and fates are final by it. Events at a sender's
        radio at `start_ns` itself belong to the new poses.

        Args:
            start_ns: the start of the tick; ValueError if it has passed.
            pose: x, y in m, heading in rad and height of the antenna above the floor in m, (rows, 4), or without
                heights, (rows, 3), for robots on the floor; the array must not change afterwards.
            disruption: the state of robots and radios from now on; None: unchanged.
            radio: the parameters from now on, for packets that neither wait nor are on air. Only numeric
                parameters may change. None: unchanged.

        Returns:
            All results since the last step, those of `advance` included, and the radio graph at `pose`.
        """
        pose = in_space(pose)
        self._pass_tick(start_ns, pose)
        liveness = self._liveness
        if disruption is not None:
            liveness.set_pending(disruption)
        if liveness.has_outages:
            first_new = len(self._links)
            self._model.disrupt(start_ns, liveness.pending, liveness.history)
            self._follow_links(first_new)
            self._end_receptions(start_ns, liveness.pending)
        tx_status = self._model.tx_status(liveness.present)
        if self._tx_status or len(tx_status):
            tx_status, self._tx_status = TxStatuses.joined([*self._tx_status, tx_status]), []
        if len(liveness.history.alive) > 1:
            liveness.history.drop_unused(self._model.queued["epoch"])
        final = self._threads.start(partial(self._pop_final, start_ns), len(self._links))
        self._apply(pose, radio or self.radio)
        self._pose = pose
        edges = self._model.edges(pose, liveness.present) if self._computes_graph else results.NO_EDGES
        joined = final()
        if self._parts:
            joined, self._parts = Results.joined([*self._parts, joined]), []
        return Results(joined.received, joined.finished, joined.departed, tx_status, joined.tally, edges)

    def send(self, start_ns: int, tick: int, sent: SentPackets) -> None:
        """Queue the packets that agents sent in the tick that started at `start_ns`; call `step` to it before.

        The intended receivers of a broadcast are all other robots of the arena that are alive now, of a unicast packet
        its one receiver. A packet to NOWHERE has none: it goes on air, and is retried like any unacknowledged
        packet. Senders may be in any order. ValueError, and nothing changed, for a receiver outside the arena or
        the sender itself, or for a time that has passed.
        """
        self._check_time(start_ns)
        if len(sent):
            self._accept(self._send_times.of_senders(start_ns, tick, sent.sender), sent)

    def send_times(self, start_ns: int, tick: int) -> IntArray:
        """Return the send time of each robot in the tick that starts at `start_ns`, in ns, (rows,)."""
        return self._send_times.in_tick(start_ns, tick)

    def send_at(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        """Queue packets within a tick, as `send`; `sent_at_ns` (k,) holds one time for all packets of a robot."""
        if len(sent):
            self._check_time(int(sent_at_ns[0] if len(sent) == 1 else sent_at_ns.min()))
            self._accept(sent_at_ns, sent)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Let time pass within a tick; results do not depend on how often it is called.

        Returns the packets received and the transmit statuses since the last call. The next `step` returns them again,
        with all else that became final. ValueError if positions are interpolated: the next poses are not known yet.
        """
        if self.radio.positions == "interpolated":
            raise ValueError('positions: expected "held" to let time pass before the next poses')
        self._pass_time(until_ns)
        tx_status = self._model.tx_status(self._liveness.present)
        if len(tx_status):
            self._tx_status.append(tx_status)
        since_ns, self._reported_ns = self._reported_ns, until_ns
        if until_ns < self._next_ns:
            return self._nothing, tx_status
        received, self._next_ns = results.received_between(
            since_ns, until_ns, self._packets, self._links, self._robots, self._measures
        )
        if len(self._links) >= MANY_LINKS:
            self._collect_final(until_ns)
        return received, tx_status

    def set_poses(self, at_ns: int, pose: FloatArray) -> None:
        """Let time pass within a tick to `at_ns`, and apply `pose` from then on, as `step` does."""
        self._pass_time(at_ns)
        self._model.set_poses(pose)

    def unreported(self) -> Results | None:
        """Return what became final by the last `advance` and no step has returned; None: nothing. `end` counts it."""
        self._collect_final(self._reported_ns)
        return Results.joined(self._parts) if self._parts else None

    def end(self) -> PacketCounts:
        """End the run: packets that are queued or under way end as IN_FLIGHT."""
        self._collect_final(self._reported_ns)
        self._counters.count_in_flight(self._links.rows, self._liveness.in_running_arenas(self._model.drain()))
        self._keep_links(np.zeros(len(self._links), np.bool_))
        counts = reduce(add, [part.tally for part in self._parts], self._counters.close())
        self._parts = []
        return counts

    def leave(self, ended: BoolArray) -> PacketCounts:
        """End the run in arenas `ended` (arenas,); returns the counts that `end` would return for them.

        Their packets are still simulated, but no longer reported.
        """
        self._collect_final(self._reported_ns)
        leaving, queued = np.repeat(ended, self._robots), self._liveness.in_running_arenas(self._model.queued)
        links = self._links.rows
        is_leaving = leaving[links["sender"]]
        self._counters.count_in_flight(links[is_leaving], queued[leaving[queued["sender"]]])
        self._keep_links(~is_leaving)
        counts = self._counters.close(ended)
        if self._parts:
            final = Results.joined(self._parts)
            counts += final.tally.in_arenas(ended)
            self._parts = [final.in_arenas(~ended, self._robots)]
        self._tx_status = [part.select(np.flatnonzero(~leaving[part.row])) for part in self._tx_status]
        self._liveness.leave(ended)
        return counts

    def _apply(self, pose: FloatArray, radio: Radio) -> None:
        """Apply these poses and parameters, and the pending disruption, from now on."""
        self._liveness.apply()
        if radio is not self.radio:
            self.radio = radio
            self._model.tune(self._now_ns, radio)
        self._model.set_poses(pose)

    def _accept(self, sent_at_ns: IntArray, sent: SentPackets) -> None:
        liveness = self._liveness
        invalid = self._model.accept(
            sent_at_ns, sent, liveness.others_alive, liveness.history.epoch, self._counters.counts
        )
        if invalid != NO_PACKET:
            raise ValueError(
                f"to: expected the index of another robot, 0 to {self._robots - 1}, got {sent.to[invalid]}"
            )

    def _pass_tick(self, start_ns: int, pose: FloatArray) -> None:
        """Let time pass to `start_ns`, with robots at their last poses, or on their way to `pose`."""
        if self.radio.positions == "interpolated" and self._pose is not None and len(self._model.queued):
            for part_ns, on_way in poses_between(self._now_ns, self._pose, start_ns, pose, self._wrap_m):
                self._pass_time(part_ns)
                self._model.set_poses(on_way)
        self._model.expect(pose)
        self._pass_time(start_ns)

    def _pass_time(self, until_ns: int) -> None:
        if until_ns < self._now_ns:
            raise ValueError(f"until_ns: expected at least {self._now_ns}, got {until_ns}")
        self._now_ns, first_new = until_ns, len(self._links)
        self._model.pass_time(until_ns, self._liveness.history)
        self._follow_links(first_new)

    def _collect_final(self, until_ns: int) -> None:
        """Collect the results of links that are final by `until_ns` before the next step does."""
        if (self._links.rows["final_at_ns"] <= until_ns).any():
            self._parts.append(self._pop_final(until_ns))

    def _pop_final(self, until_ns: int) -> Results:
        """Remove the links that are final by `until_ns`; return their results, without transmit statuses.

        Another thread may call it while poses are set.
        """
        received, finished, departed = results.final_by(
            *(until_ns, self._packets, self._links, self._robots, self._counters.counts, self._measures),
            has_power=self.radio.is_phy,
        )
        return Results(received, finished, departed, NO_TX_STATUSES, self._counters.close())

    def _check_time(self, at_ns: int) -> None:
        if at_ns < self._now_ns:
            raise ValueError(f"at_ns: expected at least {self._now_ns}, got {at_ns}")

    def _end_receptions(self, now_ns: int, disruption: Disruption) -> None:
        """End receptions of robots that are dead by `disruption`, and unfinished ones at radios that are off."""
        links = self._links.rows
        fate, receiver, final_at_ns = links["fate"], links["receiver"], links["final_at_ns"]
        is_open = (fate == RECEIVED) & (receiver != NO_ROBOT) & (final_at_ns > self._reported_ns)
        fate[is_open & ~disruption.radio_on[receiver] & (final_at_ns > now_ns)] = Fate.BLACKOUT
        fate[is_open & ~disruption.alive[receiver]] = Fate.RECEIVER_DEAD

    def _follow_links(self, first_new: int) -> None:
        """Follow the links from row `first_new` on, which are new; drop those of arenas that have ended."""
        if len(self._links) == first_new:
            return
        self._next_ns = 0
        if self.radio.delays is not None and self.radio.delays.keep_order:
            keep_link_order(self._packets.rows, self._links.rows, first_new, self._rows)
        if self._liveness.any_ended:
            has_ended = self._liveness.has_ended(self._links.rows["sender"])
            if has_ended[first_new:].any():
                self._keep_links(~has_ended)

    def _keep_links(self, is_kept: BoolArray) -> None:
        """Keep only the links of `is_kept` (links,) and their packets."""
        self._links.keep(is_kept, self._packets)
