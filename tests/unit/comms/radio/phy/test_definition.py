"""The PHY against its definition in plain Python: one frame, one receiver and one station at a time.

The rules are those of docs/radio.md and of the standards that it cites; keyed draws come from
`comms.base.draws`. Reception: ALOHA without fading, frames at random moments. Medium access: broadcasts of stations
within 1 m, which all sense each other, with receivers that decode no frame that overlaps another.
"""

from collections import deque
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import pairwise
from math import comb, dist, exp, floor, inf, log10

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.radio.config.phy import Reception
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import TICK_NS, in_air, make_medium, packets, with_access

US = 1000  # ns
KEY = derive_key(1, "air")  # the arena's key in `make_medium`


@dataclass(frozen=True, order=True)
class Sending:
    """A broadcast that an agent sends; `size` is that of its payload in bytes."""

    sent_ns: int
    station: int
    size: int


@dataclass(frozen=True)
class Frame:
    """A frame on air."""

    sender: int
    sequence: int
    start_ns: int
    end_ns: int
    bits: int


Packet = tuple[int, int]  # sender and sequence number
Position = tuple[float, float, float]


def draw(c0: int, c1: int, c2: int, name: str) -> float:
    """Return the keyed draw with these counters and this purpose."""
    return float(uniform(KEY, c0, c1, c2, purpose(name)))


def queues(sendings: list[Sending], stations: int) -> list[deque[Sending]]:
    """Return the packets of each station, in order."""
    return [deque(sending for sending in sorted(sendings) if sending.station == s) for s in range(stations)]


def run_medium(
    radio: Radio, positions: list[Position], sendings: list[Sending]
) -> tuple[dict[Packet, int], dict[tuple[int, int, int], Fate]]:
    """Run all packets over a medium; return the times on air, and the fates by sender, sequence and receiver."""
    pose, medium, on_air_ns, fates = in_air(*positions), make_medium(radio, len(positions)), {}, {}
    medium.step(0, pose)
    for sending in sorted(sendings):
        medium.send_at(np.array([sending.sent_ns]), packets([sending.station], size=[sending.size]))
    for tick in range(1, 10):
        results = medium.step(tick * TICK_NS, pose)
        departed, finished = results.departed, results.finished
        for sender, sequence, fate, start_ns in zip(
            departed.sender, departed.sequence, departed.fate, departed.on_air_at_ns, strict=True
        ):
            if fate == Fate.RECEIVED:
                on_air_ns[int(sender), int(sequence)] = int(start_ns)
        for *link, fate in zip(finished.sender, finished.sequence, finished.receiver, finished.fate, strict=True):
            fates[tuple(map(int, link))] = Fate(fate)
    assert sum(medium.end().fates[0]) == 0, "every packet has its fate"
    return on_air_ns, fates


# Reception: power, detection of preambles, capture, SINR over chunks, and the keyed decision.


ALOHA = replace(with_access("aloha"), cut_off_db=60.0, reception=Reception("802.15.4", sensitivity_dbm=-107.0))
NOISE_MW = 1.380649e-23 * 290.0 * 5e6 * 1e3
MIN_PREAMBLE_SINR = 10.0**-0.5
SENSITIVITY_MW = 10.0**-10.7
TOLERANCE = 2e-3  # the model interpolates success in a table


def power_mw(a: Position, b: Position) -> float:
    """Return the received power: 0 dBm, less 46.6777 dB at 1 m and 30 dB per decade."""
    return 10.0 ** (-0.1 * (46.6777 + 30.0 * log10(max(dist(a, b), 1.0))))


def success(sinr: float, bits: float) -> float:
    """Return the probability of `bits` bits of IEEE 802.15.4 without error (2006, E.4.1.7)."""
    terms = ((-1) ** k * comb(16, k) * exp(20.0 * sinr * (1.0 / k - 1.0)) for k in range(2, 17))
    return (1.0 - min(max(8.0 / 15.0 / 16.0 * sum(terms), 0.0), 0.5)) ** bits


def aloha_frames(sendings: list[Sending], stations: int) -> list[Frame]:
    """Return the frames in the order in which they start: at once, or after the station's frame before."""
    frames = []
    for station, queue in enumerate(queues(sendings, stations)):
        free_ns = 0
        for sequence, sending in enumerate(queue):
            start_ns, bits = max(sending.sent_ns, free_ns), 8 * (sending.size + 17)
            free_ns = start_ns + bits * 4 * US
            frames.append(Frame(station, sequence, start_ns, free_ns, bits))
    return sorted(frames, key=lambda frame: (frame.start_ns, frame.sender))


def locked_frames(frames: list[Frame], power: dict[int, float], receiver: int) -> list[Frame]:
    """Return the frames to which a receiver locks, and stays locked; `power` in mW by sender."""
    locked, lost = [], set()
    for k, frame in enumerate(frames):
        now_ns, before = frame.start_ns, [other for other in frames[:k] if other.end_ns > frame.start_ns]
        current = locked[-1] if locked and locked[-1].end_ns > now_ns and locked[-1] not in lost else None
        if frame.sender == receiver:
            lost.add(current)
            continue
        others_mw = sum(power[other.sender] for other in before if other.sender != receiver)
        detects = power[frame.sender] >= MIN_PREAMBLE_SINR * (NOISE_MW + others_mw)
        detects = detects and not any(other.sender == receiver for other in before)
        if current is None:
            if detects:
                locked.append(frame)
        elif current.start_ns == now_ns:  # capture window 0: only of frames that start together
            drowning_mw = NOISE_MW + others_mw - power[current.sender] + power[frame.sender]
            drowned = power[current.sender] < MIN_PREAMBLE_SINR * drowning_mw
            captures = detects and (drowned or power[frame.sender] > power[current.sender])
            if drowned or captures:
                lost.add(current)
            if captures:
                locked.append(frame)
    return [frame for frame in locked if frame not in lost]


def frame_success(frame: Frame, frames: list[Frame], power: dict[int, float], receiver: int) -> float:
    """Return the probability that the receiver decodes a frame: the product over chunks of constant interference."""
    others = [other for other in frames if other.sender not in (frame.sender, receiver)]
    changes = {time_ns for other in others for time_ns in (other.start_ns, other.end_ns)}
    inside = [time_ns for time_ns in changes if frame.start_ns < time_ns < frame.end_ns]
    product = 1.0
    for start_ns, stop_ns in pairwise(sorted({frame.start_ns, *inside, frame.end_ns})):
        on_air = [other for other in others if other.start_ns <= start_ns < other.end_ns]
        sinr = power[frame.sender] / (NOISE_MW + sum(power[other.sender] for other in on_air))
        product *= success(sinr, frame.bits * (stop_ns - start_ns) / (frame.end_ns - frame.start_ns))
    return product


def fates_at(receiver: int, frames: list[Frame], positions: list[Position]) -> dict[Frame, set[Fate]]:
    """Return the possible fates of each frame at a receiver: more than one where a draw is near a probability."""
    power = {s: power_mw(positions[s], positions[receiver]) for s in range(len(positions)) if s != receiver}
    locked, fates = locked_frames(frames, power, receiver), {}
    for frame in frames:
        if frame.sender == receiver:
            continue
        snr = power[frame.sender] / NOISE_MW
        if frame not in locked:
            fates[frame] = {Fate.COLLIDED if snr >= MIN_PREAMBLE_SINR else Fate.TOO_WEAK}
            continue
        u, alone = draw(frame.sender, receiver, frame.sequence, "reception"), success(snr, frame.bits)
        probability, fates[frame] = frame_success(frame, frames, power, receiver), set()
        for value in (u - TOLERANCE, u + TOLERANCE):
            lost = Fate.COLLIDED if value < alone else Fate.TOO_WEAK
            fates[frame].add(Fate.RECEIVED if value < probability else lost)
    return fates


POSITIONS = st.tuples(st.floats(-70.0, 70.0), st.floats(-70.0, 70.0), st.just(0.0) | st.floats(0.0, 70.0))


@st.composite
def traffic(draw_value: st.DrawFn, stations: int, step_ns: int, steps: int, most: int) -> list[Sending]:
    """Return broadcasts at multiples of `step_ns`, so that some coincide."""
    time_ns = st.integers(0, steps).map(lambda n: n * step_ns)
    sending = st.builds(Sending, time_ns, st.integers(0, stations - 1), st.integers(2, 60))
    return draw_value(st.lists(sending, min_size=1, max_size=most))


@given(st.integers(2, 5).flatmap(lambda n: st.tuples(st.tuples(*[POSITIONS] * n), traffic(n, 400 * US, 8, 20))))
def test_reception_agrees_with_its_definition(scene: tuple[tuple[Position, ...], list[Sending]]):
    positions, sendings = list(scene[0]), scene[1]
    on_air_ns, fates = run_medium(ALOHA, positions, sendings)
    frames = aloha_frames(sendings, len(positions))
    assert on_air_ns == {(frame.sender, frame.sequence): frame.start_ns for frame in frames}
    for receiver in range(len(positions)):
        for frame, expected in fates_at(receiver, frames, positions).items():
            is_in_range = power_mw(positions[frame.sender], positions[receiver]) >= SENSITIVITY_MW
            got = fates.get((frame.sender, frame.sequence, receiver))
            if got is None:  # out of range, and not received
                assert not is_in_range
                assert expected != {Fate.RECEIVED}
            else:
                assert got in expected
                assert is_in_range or got == Fate.RECEIVED


# Medium access: times on air of stations that sense each other.


NEAR = [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.5), (0.5, 0.5, 0.0)]
CSMA = with_access("csma-802154")
DCF = replace(with_access("dcf"), reception=Reception("threshold", preamble_sinr_db=4.0, capture_window_s=4e-6))


def csma_times(sendings: list[Sending], stations: int) -> dict[Packet, int]:
    """Return the time on air of each packet; unslotted CSMA/CA of IEEE 802.15.4 (2006, 7.5.1.4).

    The channel is busy if a frame starts during the CCA, or is on air at its end.
    """
    waiting, sequence = queues(sendings, stations), [0] * stations
    frames: list[Frame] = []
    assessments: list[tuple[int, int, int]] = []  # end of the CCA, station, NB

    def back_off(station: int, now_ns: int, nb: int) -> None:
        periods = floor(draw(station, sequence[station], nb, "csma backoff") * 2 ** min(3 + nb, 5))
        heappush(assessments, (now_ns + periods * 320 * US + 128 * US, station, nb))

    def serve(station: int, now_ns: int) -> None:
        if waiting[station]:
            back_off(station, max(now_ns, waiting[station][0].sent_ns), 0)

    for station in range(stations):
        serve(station, 0)
    while assessments:
        end_ns, station, nb = heappop(assessments)
        before = [frame for frame in frames if frame.start_ns < end_ns and frame.sender != station]
        is_busy = any(frame.start_ns >= end_ns - 128 * US or frame.end_ns > end_ns for frame in before)
        if is_busy and nb < 4:
            back_off(station, end_ns, nb + 1)
            continue
        size = waiting[station].popleft().size
        free_ns = end_ns
        if not is_busy:
            start_ns, octets = end_ns + 192 * US, size + 17
            free_ns = start_ns + octets * 32 * US
            frames.append(Frame(station, sequence[station], start_ns, free_ns, 8 * octets))
            free_ns += (192 if octets - 6 <= 18 else 640) * US
        sequence[station] += 1
        serve(station, free_ns)
    return {(frame.sender, frame.sequence): frame.start_ns for frame in frames}


SLOT_NS, DIFS_NS, CCA_TIME_NS = 20 * US, 50 * US, 4 * US


def dcf_times(sendings: list[Sending], stations: int) -> dict[Packet, int]:
    """Return the time on air of each packet; DCF of IEEE 802.11b (2007, 9.2), one busy period after the other."""
    waiting, sequence, slots = queues(sendings, stations), [0] * stations, [0] * stations
    idle_ns, on_air_ns = -inf, {}
    while any(waiting):
        due_ns = {}
        for station, queue in enumerate(waiting):
            if queue:
                counted_ns = idle_ns + DIFS_NS + slots[station] * SLOT_NS
                arrival_ns = queue[0].sent_ns
                is_late = arrival_ns > idle_ns and (slots[station] == 0 or counted_ns <= arrival_ns)
                due_ns[station] = arrival_ns + DIFS_NS if is_late else counted_ns
        start_ns = min(due_ns.values())
        # A station senses the frame only after CCA_TIME_NS, and sends if its backoff ends until then.
        senders = [s for s, ns in due_ns.items() if ns <= start_ns + CCA_TIME_NS and waiting[s][0].sent_ns < start_ns]
        counted = max(start_ns + CCA_TIME_NS - idle_ns - DIFS_NS, 0) // SLOT_NS
        slots = [max(count - counted, 0) if count else 0 for count in slots]
        idle, end_ns = [not queue or queue[0].sent_ns >= start_ns for queue in waiting], {}
        for station in senders:
            octets = waiting[station].popleft().size + 36
            end_ns[station] = due_ns[station] + 192 * US + 8 * octets * US
            on_air_ns[station, sequence[station]] = due_ns[station]
            slots[station] = floor(draw(station, sequence[station], 0, "dcf slots") * 32)
            sequence[station] += 1
            idle[station] = not waiting[station] or waiting[station][0].sent_ns >= end_ns[station]
        idle_ns = max(end_ns.values())
        for station, queue in enumerate(waiting):
            finds_busy = idle[station] and queue and queue[0].sent_ns < idle_ns
            if finds_busy and slots[station] == 0:
                slots[station] = floor(draw(station, sequence[station], 0, "dcf slots before sending") * 32)
    return on_air_ns


@given(st.integers(2, 4).flatmap(lambda n: st.tuples(st.just(n), traffic(n, 160 * US, 60, 14))))
def test_csma_times_agree_with_their_definition(scene: tuple[int, list[Sending]]):
    stations, sendings = scene
    assert run_medium(CSMA, NEAR[:stations], sendings)[0] == csma_times(sendings, stations)


@given(st.integers(2, 4).flatmap(lambda n: st.tuples(st.just(n), traffic(n, 101 * US, 60, 14))))
def test_dcf_times_agree_with_their_definition(scene: tuple[int, list[Sending]]):
    stations, sendings = scene
    assert run_medium(DCF, NEAR[:stations], sendings)[0] == dcf_times(sendings, stations)
