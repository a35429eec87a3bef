"""CRTP packets of a run's Crazyflies on its Crazyradio: the radio of a scenario with access method esb.

A client's packet is one of the station's robot to the drone, as if the client's computer were at the station; the
drone's answers and logs are packets to its station. Safelink is the medium's (`swarmwire.comms.radio.phy.esb`); a
packet that it gave up is the end of a link.
"""

from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np

from swarmwire.comms.robot.messages import CRTP_TAG
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, ReceivedPackets, SentPackets, TxResult, TxStatuses
from swarmwire.comms.wire.radio_bridge import BoundedInbox

TAG = CRTP_TAG.to_bytes(TAG_BYTES, "little")
FIRST_STATUS = 2**62  # tx status id of packets of row 0 or to it; agents count theirs from 0
MAX_WAITING = 256  # packets of clients that wait for the loop


class CrazyradioPorts:
    """The Crazyradio of the robots behind a run's Crazyflie gateways; see `PacketPorts`."""

    tag = CRTP_TAG

    def __init__(self, stations: Mapping[int, int]) -> None:
        """`stations` has, by the row of each of these robots, the row of its station."""
        self._stations = stations
        self._answer: dict[int, Callable[[bytes], bytes | None]] = {}  # by row
        self._send: dict[int, Callable[[bytes], None]] = {}
        self._lose: dict[int, Callable[[], None]] = {}
        self._inbox = BoundedInbox[tuple[int, bytes]](MAX_WAITING)
        self._answers: list[tuple[int, bytes]] = []  # row of the drone, and its packet
        self._counts = Counter[str]()

    def join(
        self,
        row: int,
        answer: Callable[[bytes], bytes | None],
        send: Callable[[bytes], None],
        lose: Callable[[], None],
    ) -> None:
        """Add a robot.

        `answer` returns its answer to a packet, `send` sends a packet to its client, `lose` ends the client's link.
        """
        self._answer[row], self._send[row], self._lose[row] = answer, send, lose

    def send_down(self, row: int, packet: bytes) -> None:
        """Send a client's packet to its robot; called by the server's thread."""
        self._inbox.put((row, packet))

    def send_up(self, row: int, packet: bytes) -> None:
        """Send a robot's packet to its client."""
        self._answers.append((row, packet))

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """See `PacketPorts`: robots answer, and clients get what the stations received."""
        if not len(received):
            return received
        is_crtp = received.payloads.tags()[received.payload] == CRTP_TAG
        for index in np.flatnonzero(is_crtp).tolist():
            receiver, sender = int(received.receiver[index]), int(received.sender_index[index])
            packet = received.payloads.row(int(received.payload[index]))[TAG_BYTES:]
            if receiver in self._answer:
                if (answer := self._answer[receiver](packet)) is not None:
                    self.send_up(receiver, answer)
            else:
                self._send[sender](packet)
        return received.select(np.flatnonzero(~is_crtp)) if is_crtp.any() else received

    def pop_packets(self) -> list[SentPackets]:
        """See `PacketPorts`."""
        answers, self._answers = self._answers, []
        queued: dict[int, list[tuple[int, bytes]]] = {}  # sender -> receivers and packets
        for row, packet in self._inbox.pop_all():
            queued.setdefault(self._stations[row], []).append((row, packet))
        for row, packet in answers:
            queued.setdefault(row, []).append((self._stations[row], packet))
        return [
            SentPackets(
                np.full(len(packets), sender),
                np.array([to for to, _ in packets]),
                Payloads.from_rows([TAG + packet for _, packet in packets]),
                np.array([FIRST_STATUS + (sender if sender in self._stations else to) for to, _ in packets]),
            )
            for sender, packets in sorted(queued.items())
        ]

    def count_sent(self, packets: SentPackets) -> None:
        """See `PacketPorts`; `accept_statuses` counts packets when they end."""

    def accept_statuses(self, tx_status: TxStatuses) -> TxStatuses:
        """Count the packets that their sender gave up, end links that are lost, and return the agents' statuses."""
        is_crtp = tx_status.id >= FIRST_STATUS
        if not is_crtp.any():
            return tx_status
        for index in np.flatnonzero(is_crtp & (tx_status.result != TxResult.ACKNOWLEDGED)).tolist():
            drone, result = int(tx_status.id[index]) - FIRST_STATUS, TxResult(int(tx_status.result[index]))
            way = "up" if int(tx_status.row[index]) == drone else "down"
            self._counts[f"crazyradio_{way}_{result.name.lower()}"] += 1
            if result is TxResult.NO_ACKNOWLEDGEMENT:
                self._lose[drone]()
        return tx_status.select(np.flatnonzero(~is_crtp))

    def counts(self) -> dict[str, int]:
        """See `PacketPorts`: packets by direction that ended without acknowledgement, and those of full queues."""
        dropped = {"crazyradio_dropped": self._inbox.dropped} if self._inbox.dropped else {}
        return {**dropped, **dict(sorted(self._counts.items()))}
