"""Small runs of the medium: fixed poses, packets by tick, everything that became final."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import BROADCAST, Fate, Payloads, SentPackets
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.results import Results
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.comms.truth import Obstacle, PacketCounts

RATE_HZ = 10
TICK_NS = tick_start_ns(1, RATE_HZ)
SIZE_M = (6.0, 5.0)


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
        tallies = [one.tally for one in self.news] + ([self.last] if self.last else [])
        return PacketCounts(*(np.sum([getattr(t, f.name) for t in tallies], axis=0) for f in fields(PacketCounts)))

    def fates(self) -> dict[str, int]:
        """Receivers by fate, those with none left out."""
        return {fate.name: int(n) for fate, n in zip(Fate, self.tally.fates.sum(axis=0), strict=True) if n}

    def received(self, name: str) -> IntArray:
        """A column of everything received, in order."""
        return np.concatenate([getattr(one.received, name) for one in self.news])

    def given(self, name: str) -> FloatArray:
        """What receivers learned, in order."""
        return np.concatenate([one.received.given[name] for one in self.news])

    def finished(self, name: str) -> IntArray:
        """A column of all links that became final, in order."""
        return np.concatenate([getattr(one.finished, name) for one in self.news])

    def on_air(self, name: str) -> IntArray:
        """The same of the links of packets that went on air."""
        return self.finished(name)[self.finished("receiver") >= 0]


def make_medium(
    radio: Radio,
    robots: int,
    seeds: Sequence[int] = (1,),
    obstacles: Sequence[Sequence[Obstacle]] | None = None,
    traces: LinkTraces | None = None,
) -> RadioMedium:
    """a medium over arenas of SIZE_M at RATE_HZ, an arena per seed."""
    keys = np.array([derive_key(seed, "air") for seed in seeds], np.uint64)
    placed = obstacle_arrays(tuple(map(tuple, obstacles or [()] * len(seeds))))
    return RadioMedium(radio, keys, robots, SIZE_M, placed, RATE_HZ, traces=traces)


def run(
    medium: RadioMedium, pose: FloatArray, sent_in: Callable[[int], SentPackets], ticks: int, quiet_ticks: int = 0
) -> Run:
    """Ticks in the loop's order with robots at rest, then quiet ones, then the end."""
    out = Run(medium)
    for tick in range(ticks + quiet_ticks + 1):
        at_ns = tick_start_ns(tick, RATE_HZ)
        out.news.append(medium.step(at_ns, pose))
        if tick < ticks:
            medium.send(at_ns, tick, sent_in(tick))
    out.last = medium.end()
    return out


def living(alive: Sequence[bool]) -> Disruption:
    """Only these robots are alive (rows,), and nothing else is disrupted."""
    return replace(Disruption.none(len(alive)), alive=np.array(alive))


def packets(sender: Sequence[int], to: Sequence[int] | int = BROADCAST, size: Sequence[int] | int = 10) -> SentPackets:
    """Packets whose bytes tell their place in the list."""
    k = len(sender)
    sizes = np.broadcast_to(np.asarray(size, np.int64), (k,))
    payloads = Payloads.of([bytes([i % 256]) * int(n) for i, n in enumerate(sizes)])
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
