"""Figures that need no other simulator: formulas, figures that standards and ns-3's own tests state, ARGoS's rule."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.ns3.comparison import THROUGHPUT, figures_of
from benchmarks.ns3.configurations import Configuration
from benchmarks.ns3.lorasim import extraction
from benchmarks.ns3.simulators import ours
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy.propagation import sensitivity_of
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.error_rates import oqpsk_bit_errors
from swarmwire.comms.radio.timing import IEEE_802_11A, ieee80211a_ns, ieee80211b_ns, ieee80211g_ns, lora_ns
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets
from swarmwire.deploy.runs.scenario_parts import radio_of

LIMIT = 0.03  # of a ratio to the stated figure, where it is a simulation's
EXACT = 1e-4
LORA_FRAMES, DER_LIMIT = 4000, 0.02
SENDERS, FRAME_BYTES, RATE_HZ, TICKS = 200, 30, 10, 300  # of ALOHA
ROBOTS, SIDE_M = 200, 12.0  # of ARGoS's rule
DRONES, ESB_OCTETS = 9, 32  # of polling
BEGIN, WINDOW_BITS, OCTETS = 16, 6, 512  # of Bianchi: slots of the first window, doublings, payload


def closed_forms(groups: Sequence[str] = ()) -> list[str]:
    """Lines of Markdown: what, by which source, what it states, what we have; of these GROUPS, or of all."""
    lines = ["| what | source | stated | ours | verdict |", "| --- " * 5 + "|"]
    lines_of_groups = (line for group in groups or GROUPS for line in GROUPS[group]())
    for quantity, source, stated, simulated, limit in lines_of_groups:
        verdict = "within" if abs(simulated / stated - 1.0) <= limit else "**miss**"
        lines.append(f"| {quantity} | {source} | {stated:.5g} | {simulated:.5g} | {verdict} |")
    return lines


Line = tuple[str, str, float, float, float]  # what, source, stated, ours, the limit of their ratio


def _bit_errors() -> Iterator[Line]:
    for sinr_db, stated in ((5, 7.386009e-14), (2, 5.131392e-07), (-1, 1.148944e-03), (-4, 3.916346e-02)):
        simulated = float(oqpsk_bit_errors(from_db(sinr_db)))
        yield (
            f"bit errors of 802.15.4 at {sinr_db} dB",
            "IEEE 802.15.4-2006, E.4.1.7; ns-3's test",
            stated,
            simulated,
            EXACT,
        )


def _airtimes() -> Iterator[Line]:
    source = "ns-3's test of durations"
    yield "802.11b, 1023 octets at 11M, µs", source, 936, _us(ieee80211b_ns(1023, 11_000_000)), 0
    yield "802.11b, 1024 octets at 1M, µs", source, 8384, _us(ieee80211b_ns(1024, 1_000_000)), 0
    yield "802.11a, 1536 octets at 54M, µs", source, 248, _us(ieee80211a_ns(1536, 54_000_000)), 0
    yield "802.11g, 1536 octets at 54M, µs", source, 254, _us(ieee80211g_ns(1536, 54_000_000)), 0


def _lora() -> Iterator[Line]:
    sheet, limit_db = "Semtech, AN1200.13, The Things Network's spreadsheet", 2.6
    yield "LoRa, 13 octets at SF9, 125 kHz, µs", sheet, 164_864, _us(lora_ns(13, 9, 125_000)), 0
    yield "LoRa, 64 octets at SF12, 125 kHz, µs", sheet, 2_793_472, _us(lora_ns(64, 12, 125_000, low_data_rate=True)), 0
    for spreading_factor, stated_dbm in ((7, -123.0), (9, -129.0), (12, -136.0)):
        radio = radio_of("lora-eu868", [f"radio.lora.spreading_factor={spreading_factor}"])
        quantity = f"LoRa, sensitivity at SF{spreading_factor}, 125 kHz, dBm, ± {limit_db:g} dB"
        yield quantity, "SX1276 data sheet, table 10", stated_dbm, sensitivity_of(radio), limit_db / -stated_dbm
    for nodes in (100, 200, 400):
        by_rule, by_medium = extraction(nodes, LORA_FRAMES, seed=1)
        quantity = f"LoRaSim's SN1, {nodes} nodes, data extraction rate, ± {DER_LIMIT:g}"
        yield quantity, "Bor et al. 2016, LoRaSim's rule", by_rule, by_medium, DER_LIMIT / by_rule


def _us(ns: float) -> float:
    return ns / 1000


def _aloha() -> Iterator[Line]:
    for load in (0.1, 0.5, 1.0):
        stated = load * np.exp(-2.0 * load)
        yield (
            f"ALOHA, frames received per airtime at {load:g} begun",
            "Abramson 1970",
            stated,
            aloha(load, TICKS),
            LIMIT,
        )


def aloha(load: float, ticks: int) -> float:
    """Frames received per airtime by one listener amidst many equal senders, each of which sends one frame a tick."""
    bit_rate_bps = round(SENDERS * RATE_HZ * FRAME_BYTES * 8 / load)
    settings = [f"radio.bit_rate_bps={bit_rate_bps}", "radio.access.method=aloha", "radio.overhead_bytes=0"]
    settings += ["radio.reception.model=threshold", "radio.reception.min_sinr_db=3"]
    radio = radio_of("ieee802154", settings)
    keys = np.array([derive_key("figure of access")], np.uint64)
    medium = RadioMedium(ChannelContext.open_space(radio, keys, SENDERS + 1, (2.0, 2.0)), RATE_HZ)
    sent = SentPackets(
        np.arange(SENDERS), np.full(SENDERS, SENDERS), Payloads.from_rows([bytes(FRAME_BYTES)] * SENDERS)
    )
    pose = np.zeros((SENDERS + 1, 3))
    received = 0
    for tick in range(ticks + 2):
        at_ns = tick_start_ns(tick, RATE_HZ)
        received += int(medium.step(at_ns, pose).tally.fates[0, Fate.RECEIVED])
        if tick < ticks:
            medium.send(at_ns, tick, sent)
    return load * received / (SENDERS * ticks)


def _bianchi() -> Iterator[Line]:
    for nodes in (5, 10, 20):
        configuration = Configuration(
            "802.11a", 6, nodes, OCTETS, 0.005 * nodes / 20, unicast=True, is_saturated=True, seeds=4
        )
        simulated = float(figures_of(configuration, ours(configuration))[THROUGHPUT].mean())
        quantity = f"{nodes} stations of 802.11a that always send, throughput each, Mbit/s"
        yield quantity, "Bianchi 2000", bianchi_mbps(nodes) / nodes, simulated / nodes, 2.0 * LIMIT


def bianchi_mbps(stations: int) -> float:
    """Saturation throughput of DCF with acknowledgements, 802.11a at 6 Mbit/s (Bianchi, IEEE J. Sel. Areas Comm. 18).

    A busy slot ends with EIFS after a collision, which lasts as long as SIFS, an acknowledgement and DIFS.
    """
    low, high = 0.0, 1.0
    for _ in range(60):  # tau falls with p, and p rises with tau
        tau = 0.5 * (low + high)
        p = 1.0 - (1.0 - tau) ** (stations - 1)
        grown = p * BEGIN * sum((2.0 * p) ** k for k in range(WINDOW_BITS))
        low, high = (tau, high) if 2.0 / (1.0 + BEGIN + grown) > tau else (low, tau)
    idle = (1.0 - tau) ** stations
    alone = stations * tau * (1.0 - tau) ** (stations - 1)
    timing, data_us, ack_us = (
        IEEE_802_11A,
        _us(ieee80211a_ns(OCTETS + 36, 6_000_000)),
        _us(ieee80211a_ns(14, 6_000_000)),
    )
    busy_us = data_us + _us(timing.sifs_ns) + ack_us + _us(timing.difs_ns)
    return 8.0 * OCTETS * alone / (idle * _us(timing.slot_ns) + (1.0 - idle) * busy_us)


def _esb() -> Iterator[Line]:
    source = "nRF24LU1+ Product Specification v1.0, 6.4.9"
    for rate, bit_rate_bps in (("250k", 250_000), ("1M", 1_000_000), ("2M", 2_000_000)):
        frame_us = (8 * (1 + 5 + ESB_OCTETS + 2) + 9) * 1e6 / bit_rate_bps
        exchange_us = ESB_OCTETS + 2 * 130 + 2 * frame_us + (6.0 if rate == "2M" else 8.2)
        quantity = f"a station that polls {DRONES} drones at {rate}, {ESB_OCTETS} octets both ways, polls of each per s"
        yield quantity, source, 1e6 / (DRONES * exchange_us), esb_polls_hz(f"crazyradio-{rate}", DRONES), EXACT


def esb_polls_hz(preset: str, drones: int) -> float:
    """Polls of each drone per second, by the intervals between its packets, if packets wait at all robots."""
    radio, keys = (
        radio_of(preset, ["radio.queue_limit=10000", "radio.send_offset=tick"]),
        np.array([derive_key("polls")], np.uint64),
    )
    context = ChannelContext.open_space(radio, keys, drones + 1, (2.0, 2.0))
    medium, pose, each = RadioMedium(context, 1), np.zeros((drones + 1, 3)), 20
    drone, station = np.repeat(np.arange(1, drones + 1), each), np.zeros(drones * each, np.int64)
    payloads = Payloads.from_rows([bytes(ESB_OCTETS)] * 2 * len(drone))
    medium.step(0, pose)
    medium.send(0, 0, SentPackets(np.append(station, drone), np.append(drone, station), payloads))
    received = medium.step(tick_start_ns(5, 1), pose).received
    at_ns = received.received_at_ns[(received.sender_index == 1) & (received.receiver == 0)]
    return 1e9 / float(np.diff(at_ns).mean())


def _argos() -> Line:
    """The medium beside ARGoS 3's rab_medium: within 3 m, and no other body on the ray between the two."""
    rng, radius_m = np.random.default_rng(1), load_body("footbot").radius_m
    xy_m = rng.uniform(-SIDE_M / 2, SIDE_M / 2, (ROBOTS, 2))
    radio, keys = radio_of("argos-rab", []), np.array([derive_key("argos")], np.uint64)
    context = ChannelContext.open_space(radio, keys, ROBOTS, (SIDE_M, SIDE_M))
    medium = RadioMedium(replace(context, radius_m=np.full(ROBOTS, radius_m)), RATE_HZ)
    pose = np.column_stack([xy_m, np.zeros(ROBOTS)])
    medium.step(0, pose)
    medium.send(
        0, 0, SentPackets(np.arange(ROBOTS), np.full(ROBOTS, BROADCAST), Payloads.from_rows([bytes(10)] * ROBOTS))
    )
    received = medium.step(tick_start_ns(1, RATE_HZ), pose).received
    linked = np.zeros((ROBOTS, ROBOTS), np.bool_)
    linked[received.sender_index, received.receiver] = True
    agreeing = int((linked == by_argos(xy_m, 3.0, radius_m)).sum()) - ROBOTS
    quantity = f"pairs of {ROBOTS} foot-bots that hear one another or not as ARGoS's rule says"
    return quantity, "ARGoS 3, rab_medium", ROBOTS * (ROBOTS - 1), agreeing, 0.0


def by_argos(xy_m: np.ndarray, range_m: float, radius_m: float) -> np.ndarray:
    """Whether j receives from i, (k, k): within the range, with no third body on the line between their centres."""
    way = xy_m[None] - xy_m[:, None]
    apart_m = np.linalg.norm(way, axis=-1)
    near = (apart_m < range_m) & (apart_m > 0.0)
    for a, b in np.argwhere(near):
        part = np.clip((xy_m - xy_m[a]) @ way[a, b] / apart_m[a, b] ** 2, 0.0, 1.0)
        off_m = np.linalg.norm(xy_m - xy_m[a] - part[:, None] * way[a, b], axis=1)
        off_m[[a, b]] = np.inf
        near[a, b] = off_m.min() > radius_m
    return near


GROUPS: dict[str, Callable[[], Iterable[Line]]] = {
    "bit errors": _bit_errors,
    "airtimes": _airtimes,
    "aloha": _aloha,
    "bianchi": _bianchi,
    "esb": _esb,
    "argos": lambda: [_argos()],
    "lora": _lora,
}
