"""Stages of a radio that lose packets: independent loss, bursts, and the chain of stages."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import typeof
from scipy import stats

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.impairments import Bursts, bursts_from_steps, bursts_of_mean
from swarmwire.comms.radio.config.presets import PRESETS, with_preset
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.stages.burst_loss import MIN_CAPACITY, bad_after
from swarmwire.comms.radio.stages.chain import stages_after
from swarmwire.comms.radio.stages.losses import AT_FRAME_NS, LOSS_MODELS, LossChain
from swarmwire.comms.radio.traces import LinkTraces
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import (
    RATE_HZ,
    SIZE_M,
    TRIO,
    BurstLinks,
    Run,
    at,
    everybody,
    living,
    make_medium,
    run,
    scattered,
    trace_of,
    with_access,
)
from tests.support.comms.radio import packets as packets_at

POSE = at((0, 0), (1, 0), (0, 1))
RATIOS = LinkTraces(
    delivery_ratio=trace_of(
        "delivery_ratio", [(0, s, r, 0.3 + 0.1 * s + 0.2 * r) for s in range(3) for r in range(3) if s != r]
    )
)
LOSSES = {
    "fixed_loss": {"loss": 0.4},
    "burst_loss": {"bursts": Bursts(0.3, 0.6, 0.9, 0.1)},
    "trace_loss": {"trace": Trace("a.csv", "none")},
}
# Frames of the same airtime, in radios in which nothing else is lost.
PHY = replace(with_access("none"), send_offset="tick")
DISK = Radio(
    9.0, bit_rate_bps=PHY.bit_rate_bps, overhead_bytes=PHY.overhead_bytes, max_payload_bytes=110, send_offset="tick"
)
KEYS = np.array([derive_key("bursts", arena) for arena in range(2)], np.uint64)
ROBOTS = 20
LINKS = 400
STANDARD_ERRORS = 4.4
LOSSY = (0.01, 0.1, 1.0, 0.0)  # p, r, 1-h, 1-k
LEAKY = (0.02, 0.25, 0.7, 0.01)
RATES = st.floats(1e-3, 1e3)
FALSE_ALARM_RATE = 1e-4
# Wald and Wolfowitz: given how many packets of a sequence are lost, the runs of equal fates are as many as in a random
# order. Two-sided, at 1 in 10,000 for each sequence; keys are fixed.
SENDERS, TICKS = 12, 1500
RADIUS_M = 0.1
BLOCKING = Radio(9.0, send_offset="tick", bodies_block=True)


def replayed(radio: Radio, ticks: int, pose: FloatArray = POSE) -> Run:
    """Everybody broadcasts in each tick."""
    traces = None if radio.trace is None else RATIOS
    return run(make_medium(radio, TRIO, range(2), traces=traces), np.tile(pose, (2, 1)), everybody(2 * TRIO), ticks, 2)


def received(result: Run) -> set[tuple[int, int, int]]:
    """Sender, receiver and sequence number of what was received."""
    return set(result.rows("received", "sender_index", "receiver", "sequence"))


def test_loss_models_are_all_tested():
    assert set(LOSSES) == {kind.name for kind in LOSS_MODELS}


@pytest.mark.parametrize("name", LOSSES)
def test_loss_models_lose_the_same_frames_in_disk_and_phy(name: str):
    disk, phy = (replayed(replace(radio, **LOSSES[name]), 40) for radio in (DISK, PHY))
    assert received(disk) == received(phy)
    assert disk.fates() == phy.fates()
    assert 100 < disk.fates()["RECEIVED"] < 400


@pytest.mark.parametrize("at_ns", [AT_FRAME_NS, 0], ids=["unit disk", "PHY"])
@pytest.mark.parametrize("name", LOSSES)
def test_radio_with_a_loss_has_the_types_of_one_without_so_nothing_is_compiled_again(name: str, at_ns: int):
    def compiled_type(radio: Radio) -> object:
        context = replace(ChannelContext.open_space(radio, KEYS[:1], TRIO, SIZE_M), traces=RATIOS)
        return typeof((LossChain.create(context).losses(at_ns, 0, TRIO), stages_after(context)))

    assert compiled_type(replace(DISK, **LOSSES[name])) == compiled_type(DISK)


@pytest.mark.parametrize("radio", [DISK, PHY], ids=["unit disk", "PHY"])
@pytest.mark.parametrize("name", LOSSES)
def test_radio_graph_counts_each_loss_model(name: str, radio: Radio):
    """Each pair is joined up to the delivery of its worse direction: 0.6, 0.57 or by the trace 0.4 to 0.7."""
    bursts = LOSSES["burst_loss"]["bursts"]
    worse = {"fixed_loss": [0.6] * 3, "burst_loss": [1.0 - bursts.loss] * 3, "trace_loss": [0.4, 0.5, 0.7]}[name]
    for enough in (0.3, 0.45, 0.55, 0.65, 0.9):
        lossy = replace(radio, min_delivery=enough, **LOSSES[name])
        medium = make_medium(lossy, TRIO, traces=RATIOS if lossy.trace else None)
        joined = [pair for pair, delivery in zip([[0, 1], [0, 2], [1, 2]], worse, strict=True) if delivery >= enough]
        assert medium.step(0, POSE).edges.tolist() == joined


def losses(bursts: Bursts, interval_s: float, packets: int, keys: np.ndarray = KEYS[:1]) -> np.ndarray:
    """Which packets of each of LINKS links are lost, (links, packets), sent every `interval_s`."""
    states = BurstLinks(bursts, keys, ROBOTS)
    sender, receiver = np.arange(LINKS) // ROBOTS, np.arange(LINKS) % ROBOTS
    lost = [
        states.lost(sender, receiver, np.full(LINKS, n), np.full(LINKS, round(n * interval_s * NS_PER_S)))
        for n in range(packets)
    ]
    return np.stack(lost, axis=1)


def is_mean(by_link: np.ndarray, expected: float) -> bool:
    return bool(abs(by_link.mean() - expected) < STANDARD_ERRORS * by_link.std() / np.sqrt(len(by_link)))


def turns_bad(bursts: Bursts, was_bad: bool, dt_s: float) -> float:
    """The probability that a link is bad after dt, read off the draw at which it changes (bisection)."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if bad_after(was_bad, dt_s, 1.0 / bursts.good_s, 1.0 / bursts.bad_s, middle):
            low = middle
        else:
            high = middle
    return low


@pytest.mark.parametrize(("p", "r", "loss_bad", "loss_good"), [LOSSY, LEAKY])
@pytest.mark.parametrize("interval_s", [0.01, 0.1, 3.0])
def test_burst_steps_convert_to_rates_and_back(p, r, loss_bad, loss_good, interval_s):
    bursts = bursts_from_steps(p, r, loss_bad, loss_good, interval_s)
    assert turns_bad(bursts, False, interval_s) == pytest.approx(p, rel=1e-12)
    assert turns_bad(bursts, True, interval_s) == pytest.approx(1.0 - r, rel=1e-12)
    assert bursts.bad_share == pytest.approx(p / (p + r), rel=1e-12)


@pytest.mark.parametrize(("steps", "stated"), [(LOSSY, 0.090909), (LEAKY, 0.061111)])
def test_burst_long_run_loss_matches_the_table(steps, stated: float):
    assert bursts_from_steps(*steps, 0.1).loss == pytest.approx(stated, abs=5e-7)


@given(RATES, RATES, st.floats(1e-6, 10.0), st.floats(1e-6, 10.0), st.booleans())
def test_burst_steps_compose(bad_s: float, good_s: float, first_s: float, then_s: float, was_bad: bool):
    bursts = Bursts(bad_s, good_s)
    after_first = turns_bad(bursts, was_bad, first_s)
    both = after_first * turns_bad(bursts, True, then_s) + (1.0 - after_first) * turns_bad(bursts, False, then_s)
    assert both == pytest.approx(turns_bad(bursts, was_bad, first_s + then_s), rel=1e-9, abs=1e-12)


@given(RATES, RATES, st.booleans())
def test_burst_state_is_constant_over_no_time_and_forgotten_over_much(bad_s: float, good_s: float, was_bad: bool):
    bursts = Bursts(bad_s, good_s)
    assert turns_bad(bursts, was_bad, 0.0) == pytest.approx(float(was_bad), abs=1e-15)
    assert turns_bad(bursts, was_bad, 1e6) == turns_bad(bursts, not was_bad, np.inf)
    assert turns_bad(bursts, was_bad, np.inf) == pytest.approx(bursts.bad_share, rel=1e-12)


@pytest.mark.parametrize(
    ("steps", "lags", "after_loss"),
    [
        (LOSSY, {1: 0.8900, 2: 0.7921, 5: 0.5584, 10: 0.3118}, 0.90000),
        (LEAKY, {1: 0.41546, 2: 0.30329, 5: 0.11798, 10: 0.02446}, 0.45118),
    ],
)
def test_burst_losses_have_the_stated_rate_and_correlation(steps, lags: dict[int, float], after_loss: float):
    bursts = bursts_from_steps(*steps, 0.05)
    lost = losses(bursts, 0.05, 1500).astype(float)
    assert is_mean(lost.mean(axis=1), bursts.loss)
    about = lost - bursts.loss
    for lag, correlation in lags.items():
        covariance = (about[:, lag:] * about[:, :-lag]).mean(axis=1)
        # The stated correlations have four or five digits.
        assert is_mean(covariance / (bursts.loss * (1.0 - bursts.loss)), correlation)
    assert is_mean((lost[:, :-1] * (lost[:, 1:] - after_loss)).mean(axis=1), 0.0)


@pytest.mark.parametrize("mean_loss", [0.0, 0.3, 0.9])
def test_burst_loss_equals_the_configured_mean(mean_loss: float):
    lost = losses(bursts_of_mean(mean_loss, 1.0, 0.0, 0.5), 0.1, 800).astype(float)
    assert is_mean(lost.mean(axis=1), mean_loss) if mean_loss else not lost.any()


@pytest.mark.parametrize("interval_s", [0.02, 0.1, 0.4])
def test_burst_duration_is_independent_of_the_send_rate(interval_s: float):
    """The share of bad time, and the correlation over 0.4 s, do not depend on the packets in between."""
    bursts = Bursts(bad_s=0.5, good_s=2.0)
    lost = losses(bursts, interval_s, round(80.0 / interval_s)).astype(float)
    assert is_mean(lost.mean(axis=1), 0.2)
    lag = round(0.4 / interval_s)
    after_04_s = (lost[:, lag:] * lost[:, :-lag]).mean(axis=1)
    assert is_mean(after_04_s, 0.2 * (0.2 + 0.8 * np.exp(-(1.0 / 0.5 + 1.0 / 2.0) * 0.4)))


def test_burst_lengths_are_geometric():
    """Chi-square over lengths 1 to 15 and more; false alarm 1 in 1000."""
    lost = losses(bursts_from_steps(0.02, 0.2, 1.0, 0.0, 0.1), 0.1, 1000)
    edges = np.diff(np.pad(lost.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.nonzero(edges == 1), np.nonzero(edges == -1)
    is_complete = (begins[1] > 0) & (begins[1] < 900)  # by where they begin, so that long ones are not left out
    lengths = (ends[1] - begins[1])[is_complete]
    counts = np.bincount(np.minimum(lengths, 16), minlength=17)[1:]
    shares = np.append(0.2 * 0.8 ** np.arange(15), 0.8**15)
    assert lengths.size > 3000
    assert stats.chisquare(counts, shares * lengths.size).pvalue > 1e-3


def test_burst_losses_are_independent_by_link_arena_and_direction():
    bursts = Bursts(0.5, 0.5)
    first, other = (losses(bursts, 0.1, 400, keys) for keys in (KEYS[:1], KEYS[1:]))
    both = (first == other).mean(axis=1)
    assert is_mean(both, 0.5)
    by_pair = first.reshape(ROBOTS, ROBOTS, -1)
    pairs = np.triu_indices(ROBOTS, 1)
    assert is_mean((by_pair == by_pair.transpose(1, 0, 2)).mean(axis=2)[pairs], 0.5)


def test_symmetric_bursts_hit_both_directions_together():
    bursts = Bursts(0.5, 0.5, symmetric=True)
    lost = losses(bursts, 0.1, 400)
    by_pair, pairs = lost.reshape(ROBOTS, ROBOTS, -1), np.triu_indices(ROBOTS, 1)
    assert np.array_equal(by_pair[pairs], by_pair.transpose(1, 0, 2)[pairs])
    assert is_mean(by_pair[pairs].mean(axis=1), 0.5)
    neighbours = by_pair[0, 1:-1] == by_pair[0, 2:]  # two links of one robot
    assert is_mean(neighbours.mean(axis=1), 0.5)


def test_symmetric_bursts_accept_times_in_any_order():
    """The way back is 0.1 s earlier but handled later; the correlation is exp(-(a + b) 0.1 s) all the same."""
    states, ticks, robot = BurstLinks(Bursts(0.5, 0.5, symmetric=True), KEYS[:1], 2 * LINKS), 400, np.arange(LINKS)
    outward, back = np.zeros((LINKS, ticks)), np.zeros((LINKS, ticks))
    for tick in range(ticks):
        sequence, at_ns = np.full(LINKS, tick), np.full(LINKS, (tick + 1) * NS_PER_S)
        outward[:, tick] = states.lost(robot, robot + LINKS, sequence, at_ns)
        back[:, tick] = states.lost(robot + LINKS, robot, sequence, at_ns - NS_PER_S // 10)
    covariance = ((outward - 0.5) * (back - 0.5)).mean(axis=1)
    assert is_mean(covariance / 0.25, np.exp(-0.4))
    assert is_mean(back.mean(axis=1), 0.5)


def packets(seed: int, count: int) -> tuple[np.ndarray, ...]:
    """Packets of random links in the order of their time, with the sequence numbers of their senders."""
    draws = np.random.default_rng(seed)
    sender, receiver = draws.integers(0, 2 * ROBOTS, (2, count))
    receiver = sender - sender % ROBOTS + receiver % ROBOTS
    at_ns = np.sort(draws.integers(0, 300 * NS_PER_S, count))
    sequence = np.array([int(np.sum(sender[:i] == sender[i])) for i in range(count)])
    return sender, receiver, sequence, at_ns


@pytest.mark.parametrize("batch", [1, 7, 400])
def test_burst_fates_are_independent_of_batches(batch: int):
    table = packets(1, 2000)
    bursts = Bursts(0.8, 0.8, 0.9, 0.1)
    at_once = BurstLinks(bursts, KEYS, ROBOTS).lost(*table)
    states = BurstLinks(bursts, KEYS, ROBOTS)
    parts = [states.lost(*(column[i : i + batch] for column in table)) for i in range(0, 2000, batch)]
    assert np.array_equal(np.concatenate(parts), at_once)
    assert 0.4 < at_once.mean() < 0.6
    assert states.lost(*np.empty((4, 0), np.int64)).shape == (0,)


def test_burst_states_forgotten_change_no_fates_and_free_memory():
    """A thousand robots whose links come and go; the past counts for 40 x 0.025 s, ten ticks."""
    draws = np.random.default_rng(2)
    robots, per_tick, ticks = 1000, 900, 60
    sender, receiver = draws.integers(0, robots, (2, ticks * per_tick))
    at_ns = np.repeat(np.arange(ticks) * NS_PER_S // 10, per_tick)
    # Some links go on from tick to tick, so that there is a past that counts.
    sender.reshape(ticks, -1)[:, :300], receiver.reshape(ticks, -1)[:, :300] = sender[:300], receiver[:300]
    table = sender, receiver, np.repeat(np.arange(ticks), per_tick), at_ns
    bursts = Bursts(0.05, 0.05)
    at_once = BurstLinks(bursts, KEYS[:1], robots)
    states = BurstLinks(bursts, KEYS[:1], robots)
    sizes, parts = [], []
    for tick in range(ticks):
        parts.append(states.lost(*(column[tick * per_tick : (tick + 1) * per_tick] for column in table)))
        sizes.append(len(states))
    assert np.array_equal(np.concatenate(parts), at_once.lost(*table))
    assert len(at_once) > 30_000
    assert max(sizes) < 20 * per_tick
    assert max(sizes) > MIN_CAPACITY


def sequences(radio: Radio) -> np.ndarray:
    """Which packets of each sender are lost to one listener, (senders, packets), one each tick."""
    pose = at(*((0.01 * i, 0.5) for i in range(SENDERS)), (0.0, 0.0))
    sent = packets_at(range(SENDERS), SENDERS)
    result = run(make_medium(radio, SENDERS + 1), pose, lambda _: sent, TICKS, 2)
    lost = np.zeros((SENDERS, TICKS), bool)
    lost[result.finished("sender"), result.finished("sequence")] = result.finished("fate") != Fate.RECEIVED
    return lost


def runs_p(lost: np.ndarray) -> float:
    """The p-value of one sequence."""
    n, a = len(lost), int(lost.sum())
    b = n - a
    runs = 1 + int(np.count_nonzero(lost[1:] != lost[:-1]))
    mean = 1.0 + 2.0 * a * b / n
    variance = (mean - 1.0) * (mean - 2.0) / (n - 1.0)
    return float(2.0 * stats.norm.sf(abs(runs - mean) / np.sqrt(variance)))


@pytest.mark.parametrize("loss", [0.1, 0.5])
def test_fixed_loss_passes_the_runs_test(loss: float):
    p = [runs_p(lost) for lost in sequences(Radio(9.0, send_offset="tick", loss=loss))]
    assert min(p) > FALSE_ALARM_RATE / SENDERS
    # And the p-values are uniform, so that the test is neither blind nor loud: Kolmogorov-Smirnov, 1 in 10,000.
    assert stats.kstest(p, "uniform").pvalue > FALSE_ALARM_RATE


@pytest.mark.parametrize("bursts", [Bursts(0.5, 2.0), Bursts(0.5, 2.0, 0.8, 0.05)])
def test_burst_loss_fails_the_runs_test_on_every_link(bursts: Bursts):
    lost = sequences(Radio(9.0, send_offset="tick", bursts=bursts))
    assert max(runs_p(link) for link in lost) < FALSE_ALARM_RATE
    assert lost.mean() == pytest.approx(bursts.loss, abs=0.05)


def medium_of(radio: Radio, robots: int, arenas: int = 1) -> RadioMedium:
    """Without obstacles, every robot with the same radius."""
    keys = np.array([derive_key("bodies", arena) for arena in range(arenas)], np.uint64)
    radius_m = np.full(robots, RADIUS_M)
    context = ChannelContext.open_space(radio, keys, robots, SIZE_M)
    return RadioMedium(replace(context, radius_m=np.tile(radius_m, arenas)), RATE_HZ)


@pytest.mark.parametrize(
    ("radio", "between_y_m", "fates"),
    [
        *((BLOCKING, y_m, {"RECEIVED": 4, "BLOCKED": 2}) for y_m in (0.0, 0.099)),
        (BLOCKING, 0.101, {"RECEIVED": 6}),
        (Radio(9.0, send_offset="tick"), 0.0, {"RECEIVED": 6}),
    ],
)
def test_body_on_the_line_blocks_both_directions(radio: Radio, between_y_m: float, fates: dict[str, int]):
    """If bodies block, which they do not by default."""
    result = run(medium_of(radio, 3), at((-1, 0), (0, between_y_m), (1, 0)), everybody(3), 1)
    assert result.fates() == fates
    assert result.tally.in_range.tolist() == [fates["RECEIVED"]]


def test_dead_bodies_block_and_edges_do_not_cross_bodies():
    pose, medium = at((-1, 0), (0, 0), (1, 0)), medium_of(BLOCKING, 3)
    assert medium.step(0, pose).edges.tolist() == [[0, 1], [1, 2]]
    assert medium.step(1, pose, living([True, False, True])).edges.tolist() == []


def test_body_blocking_of_an_arena_is_independent_of_others():
    pose = scattered(60)
    together = run(medium_of(BLOCKING, 30, 2), pose, everybody(60), 1).tally.fates
    alone = run(medium_of(BLOCKING, 30), pose[:30], everybody(30), 1).tally.fates
    assert together[0].tolist() == alone[0].tolist()
    assert together[0].tolist() != together[1].tolist()


@pytest.mark.parametrize("name", ["argos-rab", "infrared-epuck"])
def test_infrared_presets_are_blocked_by_bodies(name: str):
    assert PRESETS[name].radio["bodies_block"]
    assert with_preset({"preset": name, "bodies_block": False})["bodies_block"] is False
