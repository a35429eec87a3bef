"""Frames of 802.11a/g decoded bit by bit, against the formula of their error rates."""

import numpy as np
import pytest

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.error_rates import MODULATIONS, ofdm_success
from swarmwire.comms.radio.reception.receiver import ieee80211ag, sinr_for_db
from swarmwire.comms.radio.timing import OFDM_BITS_PER_SYMBOL

GENERATORS = (0o133, 0o171)
TAIL = 6
PUNCTURING = {  # by bits in a period: which of the two outputs of each bit are sent (IEEE 802.11-2007, 17.3.5.6)
    1: [(True, True)],
    2: [(True, True), (True, False)],
    3: [(True, True), (True, False), (False, True)],
    5: [(True, True), (True, False), (False, True), (True, False), (False, True)],  # 802.11n-2009, 20.3.11.5
}
MODES = [(2, 1), (2, 3), (4, 1), (4, 3), (16, 1), (16, 3), (64, 2), (64, 3), (64, 5)]  # points, bits in a period
BITS, FRAMES = 8 * 32, 1000


def outputs(register: IntArray) -> IntArray:
    """Both outputs of the encoder, -1 or 1, (2, …)."""
    return np.stack([1 - 2 * (np.bitwise_count(register & g).astype(np.int64) & 1) for g in GENERATORS])


def encoded(bits: IntArray) -> IntArray:
    """Coded bits of frames (f, n), -1 or 1, (f, n, 2)."""
    past = np.pad(bits, ((0, 0), (TAIL, 0)))
    length = bits.shape[1]
    register = sum(past[:, TAIL - k : TAIL - k + length] << (6 - k) for k in range(7))
    return np.moveaxis(outputs(np.asarray(register)), 0, -1)


def decoded(ratios: FloatArray) -> IntArray:
    """The likeliest bits of frames that start and end in the state 0 (Viterbi); log ratios (f, n, 2), 0 if unknown."""
    frames, length, _ = ratios.shape
    new = np.arange(64)
    before = (new & 31) << 1 | np.arange(2)[:, None]  # (2, 64) the two states before each
    signs = outputs((new >> 5) << 6 | before)  # (2, 2, 64)
    metric = np.full((frames, 64), -np.inf)
    metric[:, 0] = 0.0
    chosen = np.empty((length, frames, 64), np.int8)
    for step in range(length):
        branch = np.einsum("fo,ops->fps", ratios[:, step], signs.astype(np.float64))
        candidate = metric[:, before] + branch
        chosen[step] = candidate.argmax(axis=1)
        metric = candidate.max(axis=1)
    bits, state, row = np.empty((frames, length), np.int64), np.zeros(frames, np.int64), np.arange(frames)
    for step in range(length - 1, -1, -1):
        bits[:, step] = state >> 5
        state = before[chosen[step, row, state], state]
    return bits


def received(coded: IntArray, points: int, sinr: float, rng: np.random.Generator) -> FloatArray:
    """Log ratios of coded bits (f, n) after Gray mapping and white noise; exact, of each bit on its own."""
    side = 2 if points <= 4 else round(np.sqrt(points))
    bits = side.bit_length() - 1
    frames, length = coded.shape
    padded = np.pad((1 - coded) // 2, ((0, 0), (0, -length % bits))).reshape(frames, -1, bits)
    label = np.arange(side) ^ np.arange(side) >> 1
    level = np.arange(1 - side, side, 2) / np.sqrt((side**2 - 1) / 3.0)
    order = np.argsort(label)
    # A real component has half of the noise; but for BPSK half of the signal, too.
    deviation = np.sqrt(0.5 / sinr) * (1.0 if points == 2 else np.sqrt(2.0))
    sent = level[order[padded @ (1 << np.arange(bits))]]
    distance = (sent + deviation * rng.standard_normal(sent.shape))[..., None] - level
    likelihood = np.exp(-0.5 * (distance / deviation) ** 2) + 1e-300
    ratios = [
        np.log(likelihood[..., is_zero].sum(-1) / likelihood[..., ~is_zero].sum(-1))
        for is_zero in ((label >> bit & 1) == 0 for bit in range(bits))
    ]
    return np.stack(ratios, axis=-1).reshape(frames, -1)[:, :length]


def frame_losses(points: int, period: int, sinr: float, rng: np.random.Generator) -> float:
    """The share of FRAMES frames of BITS bits with an error, each with an interleaver of its own."""
    bits = np.pad(rng.integers(0, 2, (FRAMES, BITS)), ((0, 0), (0, TAIL)))
    coded = encoded(bits)
    length = bits.shape[1]
    is_sent: BoolArray = np.resize(np.array(PUNCTURING[period]), (length, 2)).ravel()
    order = rng.permuted(np.tile(np.arange(int(is_sent.sum())), (FRAMES, 1)), axis=1)
    interleaved = np.take_along_axis(coded.reshape(FRAMES, -1)[:, is_sent], order, axis=1)
    ratios = np.zeros((FRAMES, 2 * length))
    in_place = np.empty(interleaved.shape)
    np.put_along_axis(in_place, order, received(interleaved, points, sinr, rng), axis=1)
    ratios[:, is_sent] = in_place
    return float(np.mean((decoded(ratios.reshape(FRAMES, length, 2)) != bits).any(axis=1)))


@pytest.mark.parametrize("rate_bps", [*OFDM_BITS_PER_SYMBOL, 65_000_000])
def test_soft_decisions_lose_as_many_frames_as_the_bound_within_0_4_db(rate_bps: int):
    """Where the bound is a tenth, fewer are lost, but as many within 0.4 dB: 1,000 frames have errors of 0.008."""
    rate = MODULATIONS[rate_bps]
    points, period = MODES[rate]
    sinr_db = sinr_for_db(ieee80211ag(rate_bps), 0.9, BITS)
    lost = frame_losses(points, period, from_db(sinr_db), np.random.default_rng(rate))
    assert 1.0 - ofdm_success(rate, from_db(sinr_db + 0.4), BITS) < lost < 0.1
