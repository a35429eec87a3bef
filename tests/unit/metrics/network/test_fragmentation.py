"""Fragmentation: when the radio graph fell apart, how long for, and how long it took to be whole again."""

from statistics import median

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.network.fragmentation import Fragmentations, Fragmented, RejoinMedian, RejoinWorst, Unrejoined
from tests.support.metrics.truths import edges, in_each_tick, static, truth, watch

NAMES = ("fragmentations", "rejoin_median", "rejoin_worst", "unrejoined")
KINDS = (Fragmentations, RejoinMedian, RejoinWorst, Unrejoined)
WHOLE, SPLIT = edges((0, 1)), edges()


def events_of(ticks, hold):
    """The length of each event in ticks, of a string as `seen_ticks` takes it; None: open at the end."""
    whole = [tick for tick, shown in enumerate(ticks) if shown == "+"]
    found = []
    for this, following in zip(whole, [*whole[1:], None], strict=False):
        apart = [tick for tick in range(this, following or len(ticks)) if ticks[tick] == "-"]
        if apart and apart[-1] - apart[0] >= hold:
            found.append(following - apart[0] if following else None)
    return found


def seen_ticks(of, ticks):
    """Of one arena with two robots: + joined, - apart, 0 all dead; at 10 ticks per second."""
    for tick, shown in enumerate(ticks):
        yield truth(of, tick, edges=WHOLE if shown == "+" else SPLIT, alive=np.full(2, shown != "0"))


def finals(ticks, hold_s=None):
    """What the four metrics say in the end of ticks as `seen_ticks` takes them."""
    of = static(2)
    metrics = Metrics(list(NAMES) if hold_s is None else [kind(hold_s=hold_s) for kind in KINDS])
    watch(of, seen_ticks(of, ticks), metrics)
    [found] = metrics.end(None)["metrics"]
    return tuple(found[name]["final"] for name in NAMES)


NO_EVENT = (0.0, None, None, None)


@pytest.mark.parametrize(
    ("ticks", "hold_s", "exact"),
    [
        ("+" * 30, None, NO_EVENT),
        ("++" + "-" * 10 + "++", None, NO_EVENT),  # shorter than the hold
        ("++" + "-" * 11 + "++", None, (1.0, 1.1, 1.1, 0.0)),  # its length counts from its start
        ("+" + "".join("-" * n + "+" for n in (12, 30, 15, 5)), None, (3.0, 1.5, 3.0, 0.0)),
        ("+" + "-" * 20 + "+" + "-" * 40, None, (2.0, 2.0, 2.0, 0.5)),
        ("+" + "-" * 40, None, (1.0, None, None, 1.0)),
        ("+-+--+---", 0.0, (3.0, pytest.approx(0.15), 0.2, pytest.approx(1 / 3))),
        ("+" + "-" * 30 + "+", 3.1, NO_EVENT),
        ("-" * 30 + "+" * 5, None, NO_EVENT),  # it starts in pieces
        ("-" * 30 + "+" + "-" * 12 + "+", None, (1.0, 1.2, 1.2, 0.0)),
        ("+" + "-" * 15 + "0" * 10, None, (1.0, None, None, 1.0)),  # who died has not re-joined
    ],
)
def test_known_swarms_have_their_events(ticks, hold_s, exact):
    assert finals(ticks, hold_s) == exact


@given(st.text("+-0", max_size=60) | st.text("++----0", max_size=60), st.integers(0, 4))
def test_events_are_those_read_off_the_ticks(ticks, hold):
    lengths = events_of(ticks, hold)
    over = [length / 10 for length in lengths if length is not None]
    expected = (
        len(lengths) if ticks else None,
        pytest.approx(median(over)) if over else None,
        max(over) if over else None,
        pytest.approx(1 - len(over) / len(lengths)) if lengths else None,
    )
    assert finals(ticks, hold_s=hold / 10) == expected


@given(st.text("+++-----0", min_size=1, max_size=60), st.integers(0, 4))
def test_fragmented_is_the_share_of_the_time_in_events_without_their_holds(ticks, hold):
    of = static(2)
    found = in_each_tick(of, seen_ticks(of, ticks), Fragmented(hold_s=hold / 10)).ravel().tolist()
    assert set(found) <= {0.0, 1.0}
    starts = [tick for tick, (before, now) in enumerate(zip([0.0, *found], found, strict=False)) if now > before]
    lengths = events_of(ticks, hold)
    assert len(starts) == len(lengths)
    closed = sum(length - hold for length in lengths if length is not None)
    still_open = len(ticks) - starts[-1] if lengths and lengths[-1] is None else 0
    # Who all died within the hold is counted at the first split tick after it, which is later than the hold.
    assert sum(found) == closed + still_open if "0" not in ticks else sum(found) <= closed + still_open
