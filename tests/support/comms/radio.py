"""Radios without a world: media, traffic, bursts, measured values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pkgutil import iter_modules
from typing import Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio import config
from swarmwire.comms.radio.config.impairments import BearingMeasure, Bursts, Measures, RangeMeasure, RssiMeasure
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Access, Bodies, Fading, ReceiverNoise, Reception, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption, Jammers
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.radio.results import Results
from swarmwire.comms.radio.stages.burst_loss import BurstLoss
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import AT_FRAME_NS, LossChain, frame_fate
from swarmwire.comms.radio.traces import LinkTrace, LinkTraces, Quantity, link_trace
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets

RATE_HZ = 10
TICK_NS = tick_start_ns(1, RATE_HZ)
SIZE_M = (6.0, 5.0)
RADIOS = st.builds(
    Radio,
    range_m=st.floats(0.1, 9.0),
    line_of_sight=st.booleans(),
    loss=st.sampled_from([0.0, 0.3, 1.0]),
    latency_s=st.sampled_from([0.0, 0.1, 0.25]),
    jitter_s=st.sampled_from([0.0, 0.02, 0.3]),
    bit_rate_bps=st.sampled_from([300, 2_000, 250_000]),
    overhead_bytes=st.integers(0, 20),
    max_payload_bytes=st.integers(10, 60),
    queue_limit=st.integers(0, 4),
    send_offset=st.sampled_from(["uniform", "tick", 0.0, 0.03, 0.25]),
)
OBSTACLES = [Obstacle("cylinder", 0.5, 0.5, radius_m=0.4), Obstacle("box", -1.0, -1.0, 0.3, size_m=(1.5, 0.4))]
MODULES = [
    "swarmwire.comms.radio.timing",
    *(f"{config.__name__}.{module.name}" for module in iter_modules(config.__path__)),
]
TRIO = 3
Row = tuple[float, int, int, float]  # tick, sender, receiver, value
# As in ns-3: 5 MHz of noise, path loss 46.6777 dB at 1 m and exponent 3.
IEEE_802_15_4 = Radio(
    model="log-distance",
    log_distance=LogDistance(3.0, 46.6777),
    noise=ReceiverNoise(5e6, 0.0),
    overhead_bytes=17,
    max_payload_bytes=110,
    send_offset="tick",
)
WIFI_B = replace(
    IEEE_802_15_4,
    frame="802.11b",
    bit_rate_bps=1_000_000,
    overhead_bytes=36,
    noise=ReceiverNoise(22e6, 7.0),
    reception=Reception("802.11b", preamble_sinr_db=4.0, capture_window_s=4e-6),
)
WIFI_N = replace(
    WIFI_B,
    frame="802.11n",
    bit_rate_bps=65_000_000,
    overhead_bytes=38,
    noise=ReceiverNoise(20e6, 7.0),
    reception=Reception("802.11ag", preamble_sinr_db=4.0, capture_window_s=4e-6),
    access=Access("dcf"),
)
ALL_MEASURES = Measures(RangeMeasure(0.1), BearingMeasure(0.1), RssiMeasure(0.5))
METHODS = ("none", "aloha", "csma-802154", "dcf")
# No scenario has bursts over 802.11n: `make test` does not compile its events for them, which takes ten seconds.
HAS_MANY_EXAMPLES = settings().max_examples > 20


@dataclass
class Run:
    """What a medium told over a run, tick by tick."""

    medium: RadioMedium
    news: list[Results] = field(default_factory=list)
    last: PacketCounts | None = None

    @property
    def edges(self) -> IntArray:
        """Of the radio graph at the last step."""
        return self.news[-1].edges

    @property
    def tally(self) -> PacketCounts:
        """All tallies added up."""
        tallies = [step.tally for step in self.news] + ([self.last] if self.last else [])
        return PacketCounts(*(np.sum([getattr(t, f.name) for t in tallies], axis=0) for f in fields(PacketCounts)))

    def fates(self) -> dict[str, int]:
        """Receivers by fate, those with none left out."""
        return {fate.name: int(n) for fate, n in zip(Fate, self.tally.fates.sum(axis=0), strict=True) if n}

    def received(self, name: str) -> IntArray:
        """A column of everything received, in order."""
        return self._joined("received", name)

    def measured(self, name: str) -> FloatArray:
        """What receivers learned, in order."""
        return np.concatenate([step.received.measured[name] for step in self.news])

    def finished(self, name: str) -> IntArray:
        """A column of all links that became final, in order."""
        return self._joined("finished", name)

    def departed(self, name: str) -> IntArray:
        """A column of all packets that left their radio, in order."""
        return self._joined("departed", name)

    def tx_status(self, name: str) -> IntArray:
        """A column of all transmit statuses, in order."""
        return self._joined("tx_status", name)

    def rows(self, table: str, *names: str) -> list[tuple[Any, ...]]:
        """Rows of these columns of `received`, `finished`, `departed` or `tx_status`, in order."""
        return list(zip(*(self._joined(table, name).tolist() for name in names), strict=True))

    def _joined(self, table: str, name: str) -> IntArray:
        return np.concatenate([getattr(getattr(step, table), name) for step in self.news])

    def on_air(self, name: str) -> IntArray:
        """The same of the links of packets that went on air."""
        return self.finished(name)[self.finished("receiver") >= 0]


def check_fates(result: Run) -> None:
    """Fates add up to the intended receivers of each arena."""
    np.testing.assert_array_equal(result.tally.fates.sum(axis=1), result.tally.intended)
    assert (result.tally.fates >= 0).all()
    assert (result.tally.in_range <= result.tally.intended).all()


def make_medium(
    radio: Radio,
    robots: int,
    seeds: Sequence[int] = (1,),
    obstacles: Sequence[Sequence[Obstacle]] | None = None,
    traces: LinkTraces | None = None,
    threads: int = 1,
) -> RadioMedium:
    """a medium over arenas of SIZE_M at RATE_HZ, an arena per seed."""
    keys = np.array([derive_key(seed, "air") for seed in seeds], np.uint64)
    placed = obstacle_arrays(tuple(map(tuple, obstacles or [()] * len(seeds))))
    context = ChannelContext.open_space(radio, keys, robots, SIZE_M, placed)
    return RadioMedium(replace(context, traces=traces, threads=Threads(threads)), RATE_HZ)


def run(
    medium: RadioMedium,
    pose: FloatArray,
    sent_in: Callable[[int], SentPackets],
    ticks: int,
    quiet_ticks: int = 0,
    now: Mapping[int, Disruption] | None = None,
    radios: Mapping[int, Radio] | None = None,
) -> Run:
    """Ticks in the loop's order with robots at rest, then quiet ones, then the end.

    `now` holds the disruptions, and `radios` other parameters, by the tick from which they hold.
    """
    out, current = Run(medium), Disruption.none(len(pose))
    for tick in range(ticks + quiet_ticks + 1):
        at_ns = tick_start_ns(tick, RATE_HZ)
        current = (now or {}).get(tick, current)
        out.news.append(medium.step(at_ns, pose, current, (radios or {}).get(tick)))
        if tick < ticks:
            medium.send(at_ns, tick, sent_in(tick))
    out.last = medium.end()
    return out


def living(alive: Sequence[bool]) -> Disruption:
    """Only these robots are alive (rows,), and nothing else is disrupted."""
    return replace(Disruption.none(len(alive)), alive=np.array(alive))


def jammers(*rows: dict[str, Any]) -> Jammers:
    """Jammers in the first arena, always on at the origin at 20 dBm unless they say otherwise."""
    usual = {"arena": 0, "carrier": NO_ROBOT, "x_m": 0.0, "y_m": 0.0, "power_dbm": 20.0, "on_ns": 10**9}
    full = [{**usual, "period_ns": 10**9, "phase_ns": 0, **row} for row in rows]
    return Jammers._make(np.array([row[name] for row in full]) for name in Jammers._fields)


def jammed_by(held: Jammers, rows: int) -> Disruption:
    """Only these jammers disrupt."""
    return replace(Disruption.none(rows), jammers=held)


def packets(sender: Sequence[int], to: Sequence[int] | int = BROADCAST, size: Sequence[int] | int = 10) -> SentPackets:
    """Packets whose bytes tell their place in the list."""
    k = len(sender)
    sizes = np.broadcast_to(np.asarray(size, np.int64), (k,))
    payloads = Payloads.from_rows([bytes([i % 256]) * int(n) for i, n in enumerate(sizes)])
    return SentPackets(np.asarray(sender, np.int64), np.broadcast_to(np.asarray(to, np.int64), (k,)).copy(), payloads)


def everybody(rows: int) -> Callable[[int], SentPackets]:
    """A broadcast of ten bytes from every robot in every tick."""
    sent = packets(range(rows))
    return lambda _: sent


def scattered(rows: int, seed: int = 5) -> FloatArray:
    """Random poses over an arena of SIZE_M."""
    rng = np.random.default_rng(seed)
    half = np.array(SIZE_M) / 2
    return np.column_stack([rng.uniform(-half, half, (rows, 2)), rng.uniform(-np.pi, np.pi, rows)])


def at(*positions: tuple[float, ...]) -> FloatArray:
    """Poses from (x, y) or (x, y, heading)."""
    return np.array([(*p, 0.0)[:3] for p in positions], np.float64)


def in_air(*positions: tuple[float, float, float]) -> FloatArray:
    """Poses (rows, 4) from (x, y, z)."""
    return np.array([(x, y, 0.0, z) for x, y, z in positions], np.float64)


def random_traffic(rng: np.random.Generator, arenas: int, robots: int) -> SentPackets:
    """Some robots send some packets, to all or to one, in any order."""
    k = int(rng.integers(0, 3 * robots))
    sender = rng.integers(0, arenas * robots, k)
    to = (sender + rng.integers(1, robots, k)) % robots
    return packets(sender, np.where(rng.random(k) < 0.6, BROADCAST, to), rng.integers(0, 70, k))


def run_disrupted(
    medium: RadioMedium, pose: FloatArray, sent: dict[int, SentPackets], now: dict[int, Disruption], ticks: int
) -> Run:
    """What is sent, and what holds from then on, by tick."""
    return run(medium, pose, lambda tick: sent.get(tick, SentPackets.none()), ticks - 1, now=now)


class BurstLinks:
    """The links between `robots` in each arena, under burst losses alone."""

    def __init__(self, bursts: Bursts, keys: KeyArray, robots: int) -> None:
        self._keys, self._robots, self._rows = keys, robots, len(keys) * robots
        self._loss = BurstLoss(bursts, self._rows)

    def __len__(self) -> int:
        return len(self._loss)

    def change(self, bursts: Bursts, at_ns: int) -> None:
        """Other bursts from a time on."""
        previous, self._loss = self._loss, BurstLoss(bursts, self._rows)
        self._loss.continue_from(previous, at_ns)

    def lost(self, sender: IntArray, receiver: IntArray, sequence: IntArray, at_ns: IntArray) -> BoolArray:
        """Whether each packet (k,) is lost, between robot rows."""
        first_ns, by_time = int(at_ns.min(initial=2**62)), np.argsort(at_ns, kind="stable")
        losses = LossChain([self._loss]).losses(AT_FRAME_NS, first_ns, len(sender))
        fate = np.empty(len(sender), np.int64)
        fates_of_frames(fate, by_time, losses, self._keys, self._robots, sender, receiver, sequence, at_ns)
        return fate == Fate.BURST


@njit()
def fates_of_frames(
    fate: Any, order: Any, losses: Any, keys: Any, robots: int, sender: Any, receiver: Any, sequence: Any, at_ns: Any
) -> None:
    """Set the fate of each data frame (k,) between robot rows, tested in this order."""
    for k in order:
        key, first = keys[sender[k] // robots], sender[k] // robots * robots
        s, r = sender[k] - first, receiver[k] - first
        frame = ReceivedFrame(key, sender[k], receiver[k], s, r, sequence[k], 0, False, at_ns[k], at_ns[k])
        fate[k] = frame_fate(losses, frame)


def trace_of(quantity: Quantity, rows: Sequence[Row]) -> LinkTrace:
    """The trace of rows (tick, sender, receiver, value)."""
    return trace_in_ns(quantity, [(round(tick * TICK_NS), *others) for tick, *others in rows])


def trace_in_ns(quantity: Quantity, rows: Sequence[tuple[float, ...]]) -> LinkTrace:
    """The trace of rows (time in ns, sender, receiver, value)."""
    time_ns, sender, receiver, value = (np.array(column) for column in zip(*rows, strict=True))
    return link_trace(quantity, TRIO, time_ns, sender, receiver, value.astype(np.float64))


def numbers_received(result: Run, sender: int, receiver: int) -> list[int]:
    """The sequence numbers of the packets that the receiver received of the sender."""
    is_link = (result.received("sender_index") == sender) & (result.received("receiver") == receiver)
    return result.received("sequence")[is_link].tolist()


def with_access(method: str, radio: Radio = IEEE_802_15_4) -> Radio:
    """A radio with this method; of IEEE 802.11 for dcf."""
    return replace(WIFI_B if method == "dcf" else radio, access=Access(method))


def drawing(method: str) -> Radio:
    """A radio with this method and everything that draws."""
    return replace(
        with_access(method),
        send_offset="uniform",
        loss=0.1,
        jitter_s=0.05,
        shadowing=Shadowing(),
        fading=Fading(),
        bursts=Bursts(0.2, 0.4),
        measures=ALL_MEASURES,
    )


@st.composite
def signal_radios(draw: st.DrawFn) -> Radio:
    """Every method, with and without all that may be added; slow enough that frames outlast ticks."""
    radio = draw(st.sampled_from([*map(with_access, METHODS), WIFI_N]))
    slow = radio.frame == "plain" and draw(st.booleans())
    walls = draw(st.sampled_from([None, Walls(9.0)]))
    may_have_bursts = radio.frame != "802.11n" or HAS_MANY_EXAMPLES
    return replace(
        radio,
        bit_rate_bps=draw(st.sampled_from([900, 30_000])) if slow else radio.bit_rate_bps,
        max_payload_bytes=draw(st.integers(10, 60)),
        queue_limit=draw(st.integers(0, 4)),
        queue_lifetime_s=draw(st.sampled_from([None, 0.05])),
        send_offset=draw(st.sampled_from(["uniform", "tick", 0.03, 0.25])),
        loss=draw(st.sampled_from([0.0, 0.3])),
        jitter_s=draw(st.sampled_from([0.0, 0.3])),
        shadowing=draw(st.sampled_from([None, Shadowing(6.0, 2.0)])),
        fading=draw(st.sampled_from([None, Fading()])),
        bursts=draw(st.sampled_from([None, Bursts(0.1, 0.2)] if may_have_bursts else [None])),
        bodies=draw(st.sampled_from([None, Bodies()])),
        walls=walls,
        line_of_sight=walls is None and draw(st.booleans()),
        range_m=draw(st.sampled_from([None, 60.0])),
    )


def story(result: Run, robots: int, arena: int = 0) -> list[tuple[object, ...]]:
    """What is received in one arena, with what came with it, every other fate and status, by tick; then its tally."""
    rows: list[tuple[object, ...]] = []
    for tick, step in enumerate(result.news):
        h, f, t = step.received, step.finished, step.tx_status
        for i in np.flatnonzero(h.receiver // robots == arena):
            measured = tuple(column[i] for column in h.measured.values())
            columns_ = h.sender_index[i], h.sequence[i], h.received_at_ns[i], *measured, h.payloads.row(h.payload[i])
            rows.append((tick, "received", h.receiver[i] % robots, *columns_))
        columns = f.receiver, f.sender, f.sequence, f.fate, f.on_air_at_ns, f.final_at_ns
        rows += sorted((tick, "fate", *(column[i] for column in columns)) for i in np.flatnonzero(f.arena == arena))
        own = np.flatnonzero(t.row // robots == arena)
        rows += [(tick, "status", t.row[i] % robots, t.id[i], t.result[i]) for i in own]
    return [*rows, (*result.tally.fates[arena], result.tally.in_range[arena])]
