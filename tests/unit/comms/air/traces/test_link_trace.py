"""A trace tells what was measured last; what cannot be measured is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.air.traces.link_trace import RefusedRow, link_trace

ROBOTS = 3
ROWS = [(20, 2, 0, 0.3), (0, 0, 1, 1.0), (10, 0, 1, 0.5), (5, 1, 0, 0.0), (30, 0, 1, 0.25)]


def trace(rows, quantity="delivery_ratio"):
    time_ns, sender, receiver, value = (np.array(column) for column in zip(*rows, strict=True))
    return link_trace(quantity, ROBOTS, time_ns, sender, receiver, value.astype(float))


def value(of, sender: int, receiver: int, at_ns: int) -> float:
    return float(of.at(np.array([sender]), np.array([receiver]), np.array([at_ns]))[0])


@pytest.mark.parametrize(
    ("at_ns", "expected"), [(-1, np.nan), (0, 1.0), (9, 1.0), (10, 0.5), (29, 0.5), (30, 0.25), (10**15, 0.25)]
)
def test_a_value_holds_until_the_next_of_its_link(at_ns, expected):
    assert value(trace(ROWS), 0, 1, at_ns) == pytest.approx(expected, nan_ok=True)


def test_directions_are_apart_and_links_never_measured_are_unknown():
    measured = trace(ROWS)
    assert value(measured, 1, 0, 5) == 0.0
    assert np.isnan(value(measured, 1, 0, 4))
    assert np.isnan(value(measured, 2, 1, 100))
    assert np.isnan(value(measured, 0, 2, 100))


@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 2), st.integers(1, 2), st.floats(0, 1)), min_size=1),
    st.integers(-1, 51),
)
def test_every_link_is_as_its_rows_say(drawn, at_ns):
    latest = {(t, s, (s + d) % ROBOTS): v for t, s, d, v in drawn}
    rows = [(*key, v) for key, v in sorted(latest.items())]
    measured = trace(rows)
    for s in range(ROBOTS):
        for r in range(ROBOTS):
            before = [v for t, sender, receiver, v in rows if (sender, receiver) == (s, r) and t <= at_ns]
            assert value(measured, s, r, at_ns) == pytest.approx(before[-1] if before else np.nan, nan_ok=True)


@pytest.mark.parametrize(
    ("quantity", "row", "told"),
    [
        ("delivery_ratio", (1, 0, 3, 0.5), "row 1, receiver: is not one of the robots"),
        ("delivery_ratio", (1, -1, 1, 0.5), "row 1, sender: is not one of the robots"),
        ("delivery_ratio", (1, 1, 1, 0.5), "row 1, receiver: is the sender itself; expected another robot"),
        ("delivery_ratio", (1, 0, 1, 1.01), "row 1, value: expected a ratio from 0 to 1"),
        ("delivery_ratio", (1, 0, 1, np.nan), "row 1, value: expected a ratio from 0 to 1"),
        ("delay_s", (1, 0, 1, -0.1), "row 1, value: expected at least 0 s"),
        ("rssi_dbm", (1, 0, 1, -np.inf), "row 1, value: expected a number of dBm"),
        (
            "delay_s",
            (0, 0, 1, 0.5),
            "row 1, time: does not rise on this link; expected its rows in the order of time",
        ),
    ],
)
def test_what_cannot_be_is_refused(quantity, row, told):
    with pytest.raises(RefusedRow) as error:
        trace([(0, 0, 1, 0.5), row], quantity)
    assert str(error.value) == told
