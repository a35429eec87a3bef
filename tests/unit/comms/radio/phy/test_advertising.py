"""Bluetooth LE advertising: three channels, scanners that change channels, and their definition in plain Python."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.radio.config.phy import Access, Advertising, Reception
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.robot.packets import SentPackets
from tests.support.comms.radio import (
    TICK_NS,
    Run,
    check_fates,
    jammed_by,
    jammers,
    living,
    make_medium,
    packets,
    random_traffic,
    run,
    run_disrupted,
    scattered,
    story,
)
from tests.unit.world.scenario.test_bodies import radio_of

# Any overlap is fatal between equal signals: neither has 6 dB over the other.
NO_CAPTURE = Reception("threshold", min_sinr_db=6.0, preamble_sinr_db=5.0, sensitivity_dbm=-96.0)
AIRTIME_NS, GAP_NS, DELAY_NS, INTERVAL_NS = 376_000, 150_000, 10_000_000, 30_000_000  # of 27 bytes; defaults
PDUS = np.arange(3, dtype=np.int64)


def ble(**others: Any) -> Radio:
    return replace(radio_of({"preset": "ble-1M", "send_offset": "tick", **others}), reception=NO_CAPTURE)


def sent_by(senders: int) -> SentPackets:
    return packets(range(senders), size=27)


def starts_ns(senders: int, ticks: int) -> IntArray:
    """Start of each PDU (ticks, senders, 3) of packets sent at the start of each tick."""
    key, tick = derive_key(1, "air"), np.arange(ticks)[:, None]
    delay_ns = uniform(key, np.arange(senders), tick, 0, purpose("advertising delay")) * DELAY_NS
    first_ns: IntArray = tick * TICK_NS + np.floor(delay_ns).astype(np.int64)
    return first_ns[..., None] + PDUS * np.int64(AIRTIME_NS + GAP_NS)


def scanned(robots: int, start_ns: IntArray, window_ns: int) -> BoolArray:
    """True if a robot's scanner is on the PDU's channel all the time, (ticks, senders, 3, robots)."""
    share = uniform(derive_key(1, "air"), np.arange(robots), 0, 0, purpose("scan phase"))
    since_ns = start_ns[..., None] + np.floor(share * 3 * INTERVAL_NS).astype(np.int64)
    is_on_channel = since_ns // INTERVAL_NS % 3 == PDUS[:, None]
    return is_on_channel & (since_ns % INTERVAL_NS + AIRTIME_NS <= window_ns)


def receptions(robots: int, senders: int, ticks: int, window_ns: int = INTERVAL_NS) -> set[tuple[int, int, int, int]]:
    """Sequence, sender, receiver and time of all that is received: the first PDU that a scanner hears alone."""
    start_ns = starts_ns(senders, ticks)
    packets = scanned(robots, start_ns, window_ns)
    expected = set[tuple[int, int, int, int]]()
    for tick, sender, receiver in np.ndindex(ticks, senders, robots):
        for pdu in PDUS if sender != receiver else ():
            at_ns = start_ns[tick, sender, pdu]
            others = np.abs(start_ns[tick, :, pdu] - at_ns) < AIRTIME_NS
            others[sender] = False
            if receiver < senders:  # no interference to itself, but deaf in its own event
                others[receiver] = False
                event = start_ns[tick, receiver]
                if event[0] < at_ns + AIRTIME_NS and at_ns < event[2] + AIRTIME_NS:
                    continue
            if packets[tick, sender, pdu, receiver] and not others.any():
                expected.add((tick, sender, receiver, int(at_ns) + AIRTIME_NS))
                break
    return expected


def received(result: Run) -> list[tuple[int, int, int, int]]:
    return result.rows("received", "sequence", "sender_index", "receiver", "received_at_ns")


def in_one_spot(radio: Radio, robots: int, senders: int, ticks: int) -> Run:
    return run(make_medium(radio, robots), np.zeros((robots, 3)), lambda _: sent_by(senders), ticks, 1)


@pytest.mark.parametrize("window_s", [None, 0.015])
def test_lone_advertiser_is_received_once_by_each_scanner_on_one_of_its_channels(window_s: float | None):
    """All but the events across a change from the last channel to the first; with half a window half of them.

    Of the start of an event within 3 scan intervals, these are lost: its duration at the end of each third interval.
    """
    robots, ticks = 60, 20
    radio = ble(advertising={} if window_s is None else {"scan_window_s": window_s})
    result = in_one_spot(radio, robots, 1, ticks)
    window_ns = INTERVAL_NS if window_s is None else round(window_s * 1e9)
    rows = received(result)
    assert len(rows) == len(set(rows))
    assert set(rows) == receptions(robots, 1, ticks, window_ns)
    event_ns = 3 * AIRTIME_NS + 2 * GAP_NS
    delivery = len(rows) / (ticks * (robots - 1))
    assert delivery == pytest.approx(1.0 - event_ns / (3 * INTERVAL_NS) if window_s is None else 0.5, abs=0.03)
    assert result.fates() == {"RECEIVED": len(rows), "NOT_LISTENING": ticks * (robots - 1) - len(rows)}
    assert set(result.departed("off_air_at_ns") - result.departed("on_air_at_ns")) == {3 * AIRTIME_NS}
    check_fates(result)


def test_synchronous_advertisers_collide_on_each_channel_as_in_their_definition():
    """15 events within 10 ms at 20 robots, also at the senders: overlaps on a scanner's channel are lost."""
    result = in_one_spot(ble(), 20, 15, 6)
    rows = received(result)
    assert len(rows) == len(set(rows))
    assert set(rows) == receptions(20, 15, 6)
    # Two delays of 0 to W are closer than T with 1 - (1 - T / W)^2: at a scanner that sends nothing.
    alone = (1.0 - AIRTIME_NS / DELAY_NS) ** (2 * 14)
    scanner = [row for row in rows if row[2] >= 15]
    assert len(scanner) / (6 * 15 * 5) == pytest.approx(alone, abs=0.1)


def disrupted(ticks: int, robots: int) -> dict[int, Disruption]:
    """Radios that are off, and robots that die, while frames are on air."""
    rng, now = np.random.default_rng(3), dict[int, Disruption]()
    for tick in range(0, ticks, 2):
        alive = np.arange(robots) != (2 if tick > 4 else -1)
        now[tick] = replace(living(alive.tolist()), radio_on=rng.random(robots) < 0.8)
    return now


@pytest.mark.parametrize("kind", ["still", "disrupted"])
def test_one_channel_without_delay_is_aloha(kind: str):
    """Frames of 30 ms and more, so that many are on air between ticks."""
    radio, robots = replace(radio_of({"preset": "ble-1M"}), bit_rate_bps=9_600, loss=0.1, send_offset="uniform"), 6
    one = replace(radio, advertising=Advertising(channels=1, max_delay_s=0.0))
    rng = np.random.default_rng(7)
    sent = {tick: random_traffic(rng, 1, robots) for tick in range(10)}
    now = {} if kind == "still" else disrupted(12, robots)
    pose = scattered(robots)
    aloha, advertising = (
        story(run_disrupted(make_medium(each, robots), pose, sent, now, 16), robots)
        for each in (replace(radio, access=Access("aloha"), advertising=None), one)
    )
    assert sorted(map(str, advertising)) == sorted(map(str, aloha))


@pytest.mark.parametrize("phase_ns", [0, 50_000_000])
def test_jammer_drowns_all_channels_while_it_is_on(phase_ns: int):
    """It is on in one half of each tick, and events are in the first half."""
    robots, pulses = 20, jammers({"on_ns": TICK_NS // 2, "period_ns": TICK_NS, "phase_ns": phase_ns})
    now = {0: jammed_by(pulses, robots)}
    result = run(make_medium(ble(), robots), np.zeros((robots, 3)), lambda _: sent_by(1), 6, now=now)
    met = receptions(robots, 1, 6)
    is_jammed = phase_ns == 0
    assert set(received(result)) == (set() if is_jammed else met)
    assert result.fates().get("JAMMED", 0) == (len(met) if is_jammed else 0)
