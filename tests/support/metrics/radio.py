"""Runs with a radio, and logs to fit one to."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Access, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves, shadowing_db
from swarmwire.metrics.real.radio_fit.losses import LossSequences
from tests.support.comms.radio import BurstLinks, make_medium, scattered, with_access
from tests.support.metrics.truths import static, truth
from tests.unit.comms.radio.test_accounts import OBSTACLES, random_traffic

EXPONENT, RSSI_AT_1_M_DBM = 2.7, -40.0
NOISE_DB = 1.5
ARENA_M = 100.0
DISK = Radio(range_m=2.0, loss=0.2, latency_s=0.15, jitter_s=0.1, bit_rate_bps=20_000, queue_limit=2)
RADIOS = (
    DISK,
    replace(DISK, bit_rate_bps=2_000, latency_s=0.0),  # packets outlast ticks
    replace(with_access("none"), bit_rate_bps=20_000, jitter_s=0.1),
    replace(with_access("aloha"), bit_rate_bps=2_000),
    replace(with_access("dcf"), access=Access("dcf", acknowledged=False)),
)


class Made(NamedTuple):
    """Columns of a log; rows of lost packets have no RSSI."""

    t_s: np.ndarray
    tx: list[str]
    rx: list[str]
    seq: np.ndarray
    rssi_dbm: np.ndarray
    ends_m: np.ndarray
    lost: np.ndarray


def made(key: int, shadowing: Shadowing, bursts: Bursts | None, links: int = 25, packets: int = 200) -> Made:
    """Robots that speak on links while they walk; every link's packets come at uneven times around 0.1 s apart."""
    draws = np.random.default_rng(key)
    t_s = np.cumsum(0.1 * draws.uniform(0.5, 1.5, (packets, links)), axis=0)
    ends_m = _walks(draws, links, packets)
    waves = field_waves(np.array([derive_key("fit", key)], np.uint64), shadowing)[0]
    field_db = [shadowing_db(waves, amplitude_db(shadowing), *row) for row in ends_m.reshape(-1, 4)]
    distance_m = np.hypot(ends_m[..., 2] - ends_m[..., 0], ends_m[..., 3] - ends_m[..., 1])
    rssi_dbm = RSSI_AT_1_M_DBM - 10.0 * EXPONENT * np.log10(distance_m) - np.reshape(field_db, (packets, links))
    rssi_dbm += NOISE_DB * draws.standard_normal((packets, links))
    lost = np.zeros((packets, links), np.bool_) if bursts is None else losses(key, bursts, t_s)
    link = np.tile(np.arange(links), packets)
    return Made(
        t_s.ravel(),
        [f"a-{i}" for i in link],
        [f"b-{i}" for i in link],
        np.repeat(np.arange(packets), links),
        np.where(lost, np.nan, rssi_dbm).ravel(),
        ends_m.reshape(-1, 4),
        lost.ravel(),
    )


def losses(key: int, bursts: Bursts, t_s: np.ndarray) -> np.ndarray:
    """Which packets (packets, links) at these times are lost."""
    packets, links = t_s.shape
    states = BurstLinks(bursts, np.array([derive_key("fit", key)], np.uint64), links)
    sender, receiver = np.arange(links), (np.arange(links) + 1) % links
    at_ns = np.round(t_s * NS_PER_S).astype(np.int64)
    return np.stack([states.lost(sender, receiver, np.full(links, n), at_ns[n]) for n in range(packets)])


def csv_of(log: Made, gaps: bool = True) -> str:
    """The log as CSV; lost packets are gaps, or rows without RSSI."""
    lines = ["t_s,tx,rx,seq,rssi_dbm,tx_x_m,tx_y_m,rx_x_m,rx_y_m"]
    for i, rssi in enumerate(log.rssi_dbm):
        if not (gaps and log.lost[i]):
            ends = ",".join(f"{value:.4f}" for value in log.ends_m[i])
            value = "" if np.isnan(rssi) else f"{rssi:.4f}"
            lines.append(f"{log.t_s[i]:.9f},{log.tx[i]},{log.rx[i]},{log.seq[i]},{value},{ends}")
    return "\n".join(lines) + "\n"


def _walks(draws: np.random.Generator, links: int, packets: int) -> np.ndarray:
    """Ends (packets, links, 4) in m of links 1 to 40 m long that wander through the arena."""
    steps = draws.standard_normal((packets, links, 2)).cumsum(axis=0)
    start = draws.uniform(0.0, ARENA_M, (links, 2)) + steps
    angle = draws.uniform(0.0, 2.0 * np.pi, links) + 0.1 * draws.standard_normal((packets, links)).cumsum(axis=0)
    length = np.exp(draws.uniform(np.log(1.0), np.log(40.0), (packets, links)))
    return np.concatenate([start, start + length[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1)], axis=-1)


def sequences(key: int, bursts: Bursts, links: int = 20, packets: int = 600) -> LossSequences:
    """Losses of packets at uneven times around 0.1 s apart, all of them known."""
    t_s = np.cumsum(0.1 * np.random.default_rng(key).uniform(0.5, 1.5, (packets, links)), axis=0)
    since_s = np.diff(t_s.T, axis=1, prepend=-np.inf)
    return LossSequences(np.repeat(np.arange(links), packets), since_s.ravel(), losses(key, bursts, t_s).T.ravel())


def ticks(radio: Radio, run: Static, seed: int, count: int = 12) -> Iterator[Truth]:
    """So many ticks in the loop's order; a robot dies in the midst, and lives again."""
    rng = np.random.default_rng(seed)
    rows = run.arenas * run.robots
    medium = make_medium(radio, run.robots, run.seeds, [OBSTACLES] * run.arenas)
    pose, states = scattered(rows, seed), Disruption.none(rows)
    for tick in range(count):
        at_ns = tick_start_ns(tick, run.rate_hz)
        alive = np.ones(rows, np.bool_)
        alive[0] = not count // 3 <= tick < 2 * count // 3
        pose = pose + rng.normal(0.0, 0.2, pose.shape)
        news = medium.step(at_ns, pose, replace(states, alive=alive))
        sent = random_traffic(rng, run.arenas, run.robots)
        living = np.flatnonzero(alive[sent.sender])
        sent = replace(sent, sender=sent.sender[living], to=sent.to[living], payloads=sent.payloads.select(living))
        medium.send(at_ns, tick, sent)
        yield truth(run, tick, pose=pose, alive=alive, tally=news.tally, finished=news.finished, departed=news.departed)


@st.composite
def radio_runs(draw: st.DrawFn) -> tuple[Static, list[Truth]]:
    """A run of any of the radios."""
    run = static(robots=draw(st.integers(2, 7)), arenas=draw(st.integers(1, 3)))
    return run, list(ticks(draw(st.sampled_from(RADIOS)), run, draw(st.integers(0, 1000))))


def rows_of(table, *columns):
    """A table's rows as plain numbers, of these columns."""
    return list(zip(*(getattr(table, name).tolist() for name in columns), strict=True))
