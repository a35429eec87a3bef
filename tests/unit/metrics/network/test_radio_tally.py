import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.fates import FATE_NAMES, Fate
from swarmwire.metrics.network.radio_tally import RadioTally
from tests.support.metrics.truths import finished, static, tally, truth


def radio(of, *ticks, last=None):
    observer = RadioTally()
    observer.begin(of)
    for tick, fields in enumerate(ticks):
        observer.see(truth(of, tick, **fields))
    return observer.end(last)["radio"]


def test_fates_add_up_to_the_intended_receivers_with_what_was_in_flight():
    ticks = [
        {"tally": tally({Fate.HEARD: 6, Fate.LOST: 2}, {Fate.OUT_OF_RANGE: 3})},
        {"tally": tally({Fate.HEARD: 1, Fate.BLOCKED: 4}, {})},
    ]
    first, second = radio(static(arenas=2), *ticks, last=tally({Fate.IN_FLIGHT: 5}, {Fate.IN_FLIGHT: 1}, sent=0))
    assert first["fates"] == {
        **dict.fromkeys(FATE_NAMES, 0),
        "heard": 7,
        "lost": 2,
        "blocked": 4,
        "in_flight": 5,
    }
    assert sum(first["fates"].values()) == first["intended"] == 18
    assert sum(second["fates"].values()) == second["intended"] == 4
    assert first["sent"] == 2


def test_the_delivery_ratio_is_heard_over_in_range_and_null_if_none_was():
    ticks = [{"tally": tally({Fate.HEARD: 3, Fate.LOST: 1, Fate.OUT_OF_RANGE: 9}, {Fate.OUT_OF_RANGE: 3})}]
    first, second = radio(static(arenas=2), *ticks)
    assert first["pdr"] == 0.75
    assert second["pdr"] is None


def test_latency_on_air_ends_at_hearing_and_to_the_agent_at_the_tick_that_hands_it_over():
    [found] = radio(static(), {"tally": tally({})}, {"finished": finished([40_000_000], [65_000_000])})
    assert found["latency_air_s"] == {p: pytest.approx(0.025, rel=0.005) for p in ("p50", "p90", "p99")}
    assert found["latency_agent_s"] == {p: pytest.approx(0.06, rel=0.005) for p in ("p50", "p90", "p99")}


def test_only_heard_packets_have_a_latency():
    lost = finished([0], [50_000_000], fate=Fate.LOST)
    [found] = radio(static(), {"tally": tally({Fate.LOST: 1}), "finished": lost})
    assert found["latency_air_s"] == {"p50": None, "p90": None, "p99": None}


def test_arenas_are_counted_apart():
    ticks = [{"tally": tally({}, {}), "finished": finished([0], [1_000_000], arena=1)}]
    first, second = radio(static(arenas=2), *ticks)
    assert first["latency_air_s"]["p50"] is None
    assert second["latency_air_s"]["p50"] == pytest.approx(0.001, rel=0.005)


def test_without_a_radio_the_summary_has_no_part_of_it():
    of, observer = static(radio=False), RadioTally()
    observer.begin(of)
    observer.see(truth(of))
    assert observer.end(None) == {}


def test_the_summary_is_plain_json():
    found = radio(static(), {"tally": tally({Fate.HEARD: 2}), "finished": finished([0, 0], [5, 7])})
    assert json.loads(json.dumps(found, allow_nan=False)) == found


@given(st.lists(st.lists(st.integers(0, 9), min_size=len(Fate), max_size=len(Fate)), max_size=5))
def test_what_the_ticks_counted_is_what_the_run_counted(ticks):
    table = np.array(ticks, np.int64).reshape(-1, len(Fate))
    seen = [{"tally": tally(dict(zip(Fate, row, strict=True)))} for row in ticks]
    [found] = radio(static(), *seen, last=tally({}))
    assert list(found["fates"].values()) == table.sum(axis=0).tolist()
    assert sum(found["fates"].values()) == found["intended"]
