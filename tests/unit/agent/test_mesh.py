"""The managed flood of `examples/mesh`: relays, hop limit, duplicates and the delay by SNR."""

from types import SimpleNamespace
from typing import Any

import pytest

from examples.mesh.flood import Flood, Text

SLOT_S = 0.01


class Draw:
    """Draws at a fixed share of their interval; the first text of the robot's own is far away."""

    def __init__(self, share: float) -> None:
        self.share = share

    def uniform(self, purpose: str, low: float, high: float) -> float:
        fixed = {"origin": 7.0, "first": 1e9}
        return fixed.get(purpose, low + self.share * (high - low))


class RadioStub:
    """A radio with given receptions, which records what is sent."""

    def __init__(self) -> None:
        self.heard: list[SimpleNamespace] = []
        self.sent: list[Text] = []

    def received(self, kind: type[Text]) -> list[SimpleNamespace]:
        assert kind is Text
        return self.heard

    def send(self, text: Text) -> None:
        self.sent.append(text)


class Air:
    """A robot's handle with a clock, a stub of a radio and fixed draws."""

    def __init__(self, draw: float = 0.0) -> None:
        self.time_s, self.value = 0.0, 0.0
        self.radio, self.draw = RadioStub(), Draw(draw)

    def note(self, *, value: float) -> None:
        self.value = value

    def step(self, agent: Any, time_s: float, *texts: tuple[Text, float]) -> list[Text]:
        self.time_s, self.radio.sent = time_s, []
        self.radio.heard = [SimpleNamespace(message=text, rssi_dbm=rssi_dbm) for text, rssi_dbm in texts]
        agent.step(self)
        return self.radio.sent


def agent() -> Flood:
    flood = Flood()
    flood.slot_s = SLOT_S
    return flood


def text(number: int = 0, hops: int = 2) -> Text:
    return Text(origin=1, number=number, hops=hops)


@pytest.mark.parametrize(
    ("snr_db", "draw", "slots"), [(-20.0, 0.0, 16), (-20.0, 0.99, 23), (10.0, 0.99, 16 + 253), (30.0, 0.5, 16 + 128)]
)
def test_flood_relays_a_text_once_after_a_delay_by_snr(snr_db: float, draw: float, slots: int):
    """Meshtastic's 2 x 8 slots and U{0 .. 2^CW - 1}, CW from 3 at -20 dB to 8 at 10 dB."""
    flood, air = agent(), Air(draw)
    assert air.step(flood, 0.0, (text(), -117.0 + snr_db)) == []
    assert air.step(flood, slots * SLOT_S - 1e-6) == []
    assert air.step(flood, slots * SLOT_S + 1e-6) == [text(hops=1)]
    assert air.step(flood, 100.0) == []
    assert air.value == 1


def test_flood_relays_no_text_without_hops():
    flood, air = agent(), Air()
    air.step(flood, 0.0, (text(hops=0), -100.0))
    assert air.step(flood, 100.0) == []
    assert air.value == 1


def test_flood_stays_silent_about_a_text_that_it_hears_again():
    flood, air = agent(), Air()
    air.step(flood, 0.0, (text(), -100.0), (text(number=1), -100.0))
    assert air.step(flood, 0.1, (text(hops=1), -100.0)) == []
    assert air.step(flood, 100.0) == [text(number=1, hops=1)]
    assert air.value == 2


def test_flood_writes_texts_with_the_full_hop_limit_and_relays_none_of_its_own():
    flood, air = agent(), Air()
    air.step(flood, 0.0)
    assert air.step(flood, 1e9) == [Text(origin=7, number=0, hops=3)]
    assert air.step(flood, 1e9 + 1.0, (Text(origin=7, number=0, hops=2), -100.0)) == []
    assert air.step(flood, 1e9 + 10.0) == []
    assert air.value == 0
