"""Keyed random draws."""

from hashlib import blake2b

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarmwire.comms.base import draws, draws_compiled

KEYS = st.integers(0, 2**64 - 1)
COUNTERS = st.tuples(*[st.integers(0, 2**32 - 1)] * 4)
MANY = np.arange(200_000)
KEY = draws.derive_key("tests", "draws")


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
    ],
)
def test_philox_matches_the_known_answers_of_random123(counter: str, key: str, expected: str) -> None:
    c = [int(word, 16) for word in counter.split()]
    low, high = (int(word, 16) for word in key.split())
    words = draws.philox(low | high << 32, *c)
    assert " ".join(f"{int(word):08x}" for word in words) == expected


@pytest.mark.parametrize("name", ["uniform", "normal"])
@given(KEYS, COUNTERS)
def test_draw_is_bit_identical_in_numpy_python_and_compiled(name: str, key: int, c: tuple[int, int, int, int]) -> None:
    compiled = getattr(draws_compiled, name)(np.uint64(key), *(np.uint64(i) for i in c))
    assert float(getattr(draws, name)(key, *c)).hex() == float(compiled).hex()
    assert getattr(draws, f"{name}_one")(key, *c).hex() == float(compiled).hex()


def test_normal_is_bit_identical_far_into_the_tails() -> None:
    table = draws.normal(KEY, MANY, 1, 2, 3)
    compiled = [draws_compiled.normal(np.uint64(KEY), c, 1, 2, 3) for c in range(20_000)]
    assert np.abs(table[:20_000]).max() > 3.5
    assert np.array_equal(table[:20_000], compiled)


@given(KEYS, COUNTERS)
def test_draw_table_equals_single_draws(key: int, c: tuple[int, int, int, int]) -> None:
    c0 = np.array([c[0], 0, 7], np.uint64)
    table = draws.normal(np.array([key, 1, 2], np.uint64), c0, *c[1:])
    assert table.shape == (3,)
    assert table[0] == draws.normal(key, *c)


@given(KEYS, COUNTERS)
def test_uniform_lies_in_the_half_open_unit_interval(key: int, c: tuple[int, int, int, int]) -> None:
    assert 0.0 <= float(draws.uniform(key, *c)) < 1.0


def test_uniform_passes_kolmogorov_smirnov() -> None:
    """Kolmogorov-Smirnov, false alarm 1 in 1000."""
    assert stats.kstest(draws.uniform(KEY, MANY, 0, 0, 0), "uniform").pvalue > 1e-3


def test_normal_passes_kolmogorov_smirnov() -> None:
    """Kolmogorov-Smirnov, false alarm 1 in 1000."""
    assert stats.kstest(draws.normal(KEY, 0, MANY, 0, 0), "norm").pvalue > 1e-3


def test_normal_has_the_moments_of_the_standard_normal() -> None:
    """Each within 4 standard errors, false alarm 1 in 4000 for the four together."""
    x = draws.normal(KEY, 0, 0, MANY, 0)
    for power, moment, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert abs(np.mean(x**power) - moment) < 4.0 * np.sqrt(variance / len(x))


@pytest.mark.parametrize("word", range(4))
def test_uniform_of_neighbouring_counters_is_uncorrelated(word: int) -> None:
    """4 standard errors, false alarm 1 in 16000."""
    first, second = ([MANY * 2 + step if i == word else 0 for i in range(4)] for step in (0, 1))
    r = np.corrcoef(draws.uniform(KEY, *first), draws.uniform(KEY, *second))[0, 1]
    assert abs(r) < 4.0 / np.sqrt(len(MANY))


def test_uniform_of_neighbouring_keys_is_uncorrelated() -> None:
    """4 standard errors, false alarm 1 in 16000."""
    keys = MANY.astype(np.uint64) * np.uint64(2)
    r = np.corrcoef(draws.uniform(keys, 1, 2, 3, 4), draws.uniform(keys + np.uint64(1), 1, 2, 3, 4))[0, 1]
    assert abs(r) < 4.0 / np.sqrt(len(MANY))


def test_uniform_depends_on_every_counter_word_and_key_half() -> None:
    base = (5, 1, 2, 3, 4)
    others = [tuple(x + (step if i == j else 0) for j, x in enumerate(base)) for i in range(5) for step in (1, 2**31)]
    others.append((5 + 2**40, 1, 2, 3, 4))
    assert len({float(draws.uniform(*other)) for other in [base, *others]}) == len(others) + 1


def test_normal_quantile_agrees_with_scipy() -> None:
    small = np.geomspace(2.0**-54, 0.5, 2001)[:-1]
    p = np.concatenate([small, 1.0 - small[small > 1e-15]])
    assert np.allclose(draws.normal_quantile(p), stats.norm.ppf(p), rtol=1e-12, atol=0.0)


def test_normal_quantile_is_finite_at_the_extreme_draws() -> None:
    lowest = 0.5 * draws.TO_UNIT
    highest = (1.0 - draws.TO_UNIT) + lowest  # rounds to one
    low, high = draws.normal_quantile(np.array([lowest, highest]))
    assert low == -high
    assert 8.0 < high < 8.5


def test_normal_quantile_is_bit_identical_in_numpy_and_compiled() -> None:
    pieces = [0.075, 0.925, np.exp(-25.0), 0.5 * draws.TO_UNIT, 1.0]  # where the three meet, and what draws can reach
    small = np.geomspace(2.0**-54, 0.5, 200)
    p = np.concatenate([pieces, np.nextafter(pieces[:4], 0.0), np.nextafter(pieces[:4], 1.0), small, 1.0 - small])
    compiled = [draws_compiled.normal_quantile(value) for value in p]
    assert draws.normal_quantile(p).tolist() == compiled


@given(st.floats(2.0**-54, 0.5))
def test_normal_quantile_never_falls(p: float) -> None:
    low, high = draws.normal_quantile(np.array([p, p * (1.0 + 1e-9)]))
    assert low <= high


def test_key_depends_on_every_part_and_their_order() -> None:
    parts = [(), (1,), (2,), ("1",), (1, 2), (2, 1), ("a",), ("a", 1), ("a", "1"), ("a1",), ("1, 2",), (12,)]
    assert len({draws.derive_key(*part) for part in parts}) == len(parts)


def test_key_and_purpose_are_the_first_bytes_of_blake2b() -> None:
    """Written out once more: a run of another version draws the same."""
    key = blake2b(b"(1, 'robot')", digest_size=8, person=b"swarmwire").digest()
    assert draws.derive_key(1, "robot") == int.from_bytes(key, "little")
    word = blake2b(b"loss", digest_size=4, person=b"purpose").digest()
    assert draws.purpose("loss") == int.from_bytes(word, "little")


def test_key_of_numpy_scalars_equals_that_of_python_values() -> None:
    key = draws.derive_key(1, "robot", 0)
    assert (type(key), 0 <= key < 2**64) == (int, True)
    assert draws.derive_key(np.int64(1), np.str_("robot"), np.uint8(0)) == key


def test_purposes_are_distinct_32_bit_words() -> None:
    words = [draws.purpose(name) for name in ("", "loss", "jitter", "Loss", "proximity noise")]
    assert len(set(words)) == len(words)
    assert all(0 <= word < 2**32 for word in words)
