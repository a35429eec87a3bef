"""Managed flood over LoRa, after Meshtastic: robots out of range of one another exchange texts.

Run it from the project's root:

    swarmwire run examples/mesh/mesh.toml

A robot that receives a text for the first time sends it again after a delay, with one hop less. The delay is short
where the packet came in weak, so that distant robots, which reach others, are first. A robot that hears the text again
in the meantime stays silent.
"""

from collections.abc import Iterator

from swarmwire.agent import Agent, Message, Robot, parameter, u1, u2, u4

SNR_DB, WINDOW = (-20.0, 10.0), (3, 8)  # Meshtastic's range of SNR, and the exponents of its contention window
Key = tuple[int, int]


class Text(Message):
    """A text on its way: its author, the author's number of it, and how often it may still be sent on."""

    origin: u4
    number: u2
    hops: u1


class Flood(Agent):
    """Writes a text at times, and sends on what it hears; it notes how many texts of others it has."""

    needs = ("radio.rssi",)
    interval_s: float = parameter(120.0, help="mean time between two texts of a robot", unit="s", above=0)
    hop_limit: int = parameter(3, help="how often a text is sent on", at_least=0, at_most=7)
    slot_s: float = parameter(0.01, help="slot of the contention window", unit="s", above=0)
    noise_dbm: float = parameter(-117.0, help="noise in the radio's bandwidth", unit="dBm")

    def __init__(self) -> None:
        self.origin: int | None = None  # drawn, since a robot does not know its index
        self.written = 0
        self.next_s = 0.0
        self.seen: set[Key] = set()
        self.waiting: dict[Key, tuple[float, Text]] = {}  # time and text to send on

    def step(self, robot: Robot) -> None:
        """Schedule new texts, cancel those that were heard again, then send what is due."""
        for packet in robot.radio.received(Text):
            text = packet.message
            key = int(text.origin), int(text.number)
            if key in self.seen:
                self.waiting.pop(key, None)
                continue
            self.seen.add(key)
            if text.hops > 0:
                delay_s = self.slot_s * self._slots(robot, packet.rssi_dbm - self.noise_dbm)
                onward = Text(origin=text.origin, number=text.number, hops=text.hops - 1)
                self.waiting[key] = robot.time_s + delay_s, onward
        for text in self._due(robot):
            robot.radio.send(text)
        robot.note(value=len(self.seen) - self.written)

    def _slots(self, robot: Robot, snr_db: float) -> float:
        """Return the delay of a client: 2 CWmax + U{0 .. 2^CW - 1} slots, CW by SNR."""
        low_db, high_db = SNR_DB
        share = min(max((snr_db - low_db) / (high_db - low_db), 0.0), 1.0)
        window = 2 ** int(WINDOW[0] + share * (WINDOW[1] - WINDOW[0]))
        return 2 * WINDOW[1] + int(robot.draw.uniform("slot", 0.0, window))

    def _due(self, robot: Robot) -> Iterator[Text]:
        for key in [key for key, (due_s, _) in self.waiting.items() if due_s <= robot.time_s]:
            yield self.waiting.pop(key)[1]
        if self.origin is None:
            self.origin = int(robot.draw.uniform("origin", 0.0, 2.0**32))
            self.next_s = robot.draw.uniform("first", 0.0, self.interval_s)
        if robot.time_s >= self.next_s:
            self.next_s += robot.draw.uniform("next", 0.5, 1.5) * self.interval_s
            self.seen.add((self.origin, self.written))
            yield Text(origin=self.origin, number=self.written, hops=self.hop_limit)
            self.written += 1
