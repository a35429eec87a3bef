"""Reports: what events told of packets, as packets and links with fates."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.lives import Lives
from swarmwire.comms.air.signal.links_held import LinksHeld
from swarmwire.comms.air.signal.tables import Table
from swarmwire.comms.air.signal.told import Told
from swarmwire.comms.air.stages.chain import chain_after_reception
from swarmwire.comms.air.stages.stage import Medium
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.air.way import Decided
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST
from swarmwire.comms.truth import NOBODY

Poses = dict[int, FloatArray]  # by hold


class Reports:
    """Makes links of what was told, and takes them through the stages that follow reception."""

    def __init__(self, medium: Medium, links: LinksHeld) -> None:
        self._robots, self._links, self._columns = medium.robots, links, len(medium.radio.gives.columns)
        self.tune(medium)

    def tune(self, medium: Medium) -> None:
        """The medium's radio has other numbers."""
        self._stages = chain_after_reception(medium)

    def decided(self, parts: list[Told], queued: Transmissions, packet: Table, poses: Poses, lives: Lives) -> Decided:
        """What was told in one go or several, of packets `queued`, which are also the rows of `packet`."""
        if not parts:
            return Transmissions.none(), Links.none(self._columns)
        row = (
            parts[0] if len(parts) == 1 else Told._make(np.concatenate(columns) for columns in zip(*parts, strict=True))
        )
        # An addressed packet may have been heard in an earlier call, and only now be done at its sender.
        used = (packet["is_done"] > 0) & (packet["is_departed"] == 0)
        used[row.packet] = True
        index, local = np.flatnonzero(used), np.cumsum(used) - 1
        was_on_air, on_air_at_ns = packet["fate"] == HEARD, packet["on_air_at_ns"].copy()
        on_air_at_ns[row.packet] = row.on_air_at_ns
        packets = queued.select(index)._replace(
            on_air_at_ns=on_air_at_ns[index],
            off_air_at_ns=(on_air_at_ns + np.where(was_on_air, packet["airtime_ns"], 0))[index],
            fate=packet["fate"][index],
        )
        kept = row.receiver != NOBODY
        if lives.any_dead:
            kept &= _meant(queued, row, lives)
        if not kept.all():
            row = Told._make([*(column[kept] for column in row[:-1]), row.count])
        in_range = self._would_reach(packets, lives)
        links = Links.with_the_rest(packets, local[row.packet], row.receiver, in_range, self._columns)
        self._tell(links.first(len(row.packet)), row, poses)
        return packets, links

    def _tell(self, links: Links, row: Told, poses: Poses) -> None:
        """Put into links what was told of them, and let them pass the stages that follow reception."""
        links.in_range[:], links.fate[:], links.final_at_ns[:] = row.in_range, row.fate, row.final_at_ns
        with np.errstate(divide="ignore"):
            links.rssi_dbm[:] = 10.0 * np.log10(row.power_mw)
        if not self._stages:
            return
        for hold in np.unique(row.hold).tolist():
            index = np.flatnonzero(row.hold == hold)
            of_hold = links.select(index)
            for stage in self._stages:
                stage.decide(of_hold, poses[hold])
            links.final_at_ns[index], links.given[index] = of_hold.final_at_ns, of_hold.given

    def _would_reach(self, packets: Transmissions, lives: Lives) -> IntArray:
        """How many receivers in range packets would have that never went on air, (packets,)."""
        found = np.zeros(len(packets.sender), np.int64)
        tried = np.flatnonzero((packets.fate != HEARD) & (packets.fate != Fate.TOO_LARGE))
        if not len(tried):
            return found
        at, receiver = self._links.reached(packets.sender[tried])
        at = tried[at]
        to_all = packets.to[at] == BROADCAST
        to_one = packets.to[at] == receiver % self._robots
        meant = to_one | (to_all & lives.intended(packets.epoch[at], receiver))
        np.add.at(found, at[meant], 1)
        return found


def _meant(queued: Transmissions, row: Told, lives: Lives) -> BoolArray:
    """Which rows are for receivers that were alive when the packet was sent, or that it was addressed to, (k,)."""
    return lives.intended(queued.epoch[row.packet], row.receiver) | (queued.to[row.packet] != BROADCAST)
