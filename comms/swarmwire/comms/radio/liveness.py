"""Robots and radios that take part in a run: alive or dead, on or off, in arenas that run or have ended."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray, Table
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption


class LivenessHistory:
    """Robots alive by epoch; an epoch begins whenever a robot dies or is revived.

    A broadcast intends the robots that were alive when it was sent.

    Attributes:
        epoch: the current epoch.
        first_epoch: the first one that is needed.
        alive: robots alive in each epoch from `first_epoch` on, (epochs, rows).
    """

    def __init__(self, rows: int) -> None:
        self.epoch = self.first_epoch = 0
        self.alive: BoolArray = np.ones((1, rows), np.bool_)

    @property
    def any_dead(self) -> bool:
        """True if a robot was dead in any of these epochs."""
        return not self.alive.all()

    def record(self, alive: BoolArray) -> None:
        """Begin an epoch with the robots `alive` (rows,), if they are not those of the current one."""
        if not np.array_equal(alive, self.alive[-1]):
            self.epoch += 1
            self.alive = np.concatenate([self.alive, alive[None]])

    def intended(self, epoch: IntArray, receiver: IntArray) -> BoolArray:
        """Return True for each robot row `receiver` that was alive in its `epoch`, (k,)."""
        return np.asarray(self.alive[epoch - self.first_epoch, receiver])

    def drop_unused(self, queued: IntArray) -> None:
        """Drop the epochs before those in which queued packets were sent; `queued` holds the epochs of these."""
        needed = int(queued.min(initial=self.epoch))
        self.alive, self.first_epoch = self.alive[needed - self.first_epoch :], needed


class Liveness:
    """Robots that are alive, radios that are on, and arenas that still run.

    A new disruption is pending until `apply` makes it the active one, together with new poses.

    Attributes:
        history: robots alive by epoch, for the intended receivers of packets.
        pending: the latest disruption.
        present: robots that are alive by it, in arenas that run, (rows,).
        others_alive: number of intended receivers of a broadcast by each robot, (rows,).
        any_ended: True if an arena has ended.
    """

    def __init__(self, context: ChannelContext) -> None:
        rows = context.rows
        self.history, self.pending = LivenessHistory(rows), Disruption.none(rows)
        self.present: BoolArray = np.ones(rows, np.bool_)
        self.others_alive: IntArray = np.zeros(rows, np.int64)
        self._robots, self._running, self._active = context.robots, context.running, context.disruption
        self._has_ended: BoolArray = np.zeros(rows, np.bool_)  # robots of arenas that have ended
        self.any_ended = False
        # True if the pending disruption is new, or an arena has ended, since the last `apply`.
        self._is_new, self._has_outages = True, False

    def set_pending(self, disruption: Disruption) -> None:
        """Set the disruption that the next `apply` makes active."""
        self.pending, self._is_new = disruption, True
        self.present = disruption.alive & ~self._has_ended

    @property
    def has_outages(self) -> bool:
        """True if any robot is dead or any radio off, by the active or by the pending disruption."""
        if not self._is_new:
            return self._has_outages
        return self.pending.has_outages or self._active.has_outages

    def apply(self) -> None:
        """Make the pending disruption the active one, in the arenas that run."""
        if not self._is_new:
            return
        # No packets are for robots of arenas that have ended, so they may count as alive.
        alive = self.pending.alive | self._has_ended
        self.history.record(alive)
        self._active.update(self.pending, alive)
        per_arena = alive.reshape(-1, self._robots).sum(axis=1)
        self.others_alive = np.repeat(per_arena, self._robots) - alive
        self._has_outages, self._is_new = self.pending.has_outages, False

    def leave(self, arenas: BoolArray) -> None:
        """End the run in `arenas` (arenas,)."""
        leaving = np.repeat(arenas, self._robots)
        self._has_ended |= leaving
        self.any_ended = self._is_new = True
        self._running &= ~arenas
        self.present = self.present & ~leaving

    def has_ended(self, sender: IntArray) -> BoolArray:
        """Return True for each robot row `sender` (k,) in an arena that has ended."""
        return self._has_ended[sender]

    def in_running_arenas(self, packets: Table) -> Table:
        """Return the packets, of type PACKET, that were sent in arenas that still run."""
        return packets[~self._has_ended[packets["sender"]]]
