import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import Fate
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.registry import standard
from swarmwire.metrics.run_folder import ticks as ticks_table
from swarmwire.metrics.run_folder.ticks import TickRecorder
from swarmwire.metrics.run_folder.writer import parts_of
from swarmwire.metrics.swarm.order import Order
from tests.support.clocks import StillClock
from tests.support.metrics.recorded import record, wandering
from tests.support.metrics.truths import edges, static, tally, truth

FIELDS = {
    "pose": ("x_m", "y_m", "heading_rad"),
    "velocity": ("vx_mps", "vy_mps", "turn_radps"),
    "command": ("command_forward_mps", "command_turn_radps"),
}


def check(table, of, seen):
    """The table holds what was seen, motion to float32."""
    shape = (len(seen), of.arenas, of.robots)
    assert table["tick"].to_list() == [one.tick for one in seen for _ in range(of.arenas)]
    assert table["time_s"].to_list() == [one.tick / of.rate_hz for one in seen for _ in range(of.arenas)]
    assert table["arena"].to_list() == list(range(of.arenas)) * len(seen)
    assert table["seed"].to_list() == list(of.seeds) * len(seen)
    for field, columns in FIELDS.items():
        for place, column in enumerate(columns):
            expected = np.array([getattr(one, field)[:, place] for one in seen], np.float32)
            assert np.array_equal(np.array(table[column].to_list(), np.float32).reshape(shape), expected.reshape(shape))
    assert np.array_equal(
        np.array(table["alive"].to_list()).reshape(shape), np.array([one.alive for one in seen]).reshape(shape)
    )
    expected = [[one.states[code] for code in one.state] for one in seen]
    assert np.array_equal(np.array(table["state"].to_list()).reshape(shape), np.array(expected).reshape(shape))


@given(ticks=st.integers(1, 25), arenas=st.integers(1, 3), robots=st.integers(1, 4), in_chunk=st.integers(1, 9))
@settings(max_examples=15, deadline=None)
def test_every_tick_comes_back_however_it_was_cut_into_parts(tmp_path_factory, ticks, arenas, robots, in_chunk):
    folder, of = tmp_path_factory.mktemp("run"), static(robots, arenas=arenas)
    seen = list(wandering(of, ticks))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ticks_table, "MAX_TICKS", in_chunk)
        recorded = record(folder, of, seen)
    assert recorded["ticks"] == {"rows": ticks * arenas, "dropped": 0}
    check(pl.read_parquet(folder / "ticks.parquet"), of, seen)


def test_metrics_are_those_measured_and_null_where_undefined(tmp_path):
    of, metrics = static(3, arenas=2), Metrics()
    recorder = TickRecorder(tmp_path, metrics, StillClock())
    expected = {name: [] for name in standard()}
    for observer in (metrics, recorder):
        observer.begin(of)
    for seen in wandering(of, 12, edges=edges((0, 1), (4, 5))):
        for observer in (metrics, recorder):
            observer.see(seen)
        for name, values in metrics.latest.items():
            expected[name] += [None if np.isnan(value) else value for value in values]
    recorder.end(None)
    table = pl.read_parquet(tmp_path / "ticks.parquet")
    assert {name: table[name].to_list() for name in standard()} == expected
    assert table["target_best"].null_count() == 24  # there is no light


def test_the_radios_counts_are_those_of_the_tick_and_null_without_a_radio(tmp_path):
    of = static(3, arenas=2)
    counted = tally({Fate.RECEIVED: 2, Fate.LOST: 1, Fate.OUT_OF_RANGE: 4}, {Fate.RECEIVED: 3}, sent=7)
    record(tmp_path, of, [truth(of, 0), truth(of, 1, tally=counted)])
    table = pl.read_parquet(tmp_path / "ticks.parquet").select("sent", "received", "in_range")
    assert table.rows() == [(None,) * 3, (None,) * 3, (7, 2, 3), (7, 3, 3)]


def test_a_slow_run_writes_a_part_every_two_seconds(tmp_path):
    of, clock, metrics = static(2), StillClock(), Metrics()
    recorder = TickRecorder(tmp_path, metrics, clock)
    for observer in (metrics, recorder):
        observer.begin(of)
    parts = []
    original = recorder._writer.put
    recorder._writer.put = lambda chunk: parts.append(chunk.rows) or original(chunk)
    for seen in wandering(of, 9):
        clock.time_ns += 7 * NS_PER_S // 10
        for observer in (metrics, recorder):
            observer.see(seen)
    assert parts == [3, 3, 3]
    recorder.end(None)
    assert parts_of(tmp_path, "ticks") == []
    assert pl.read_parquet(tmp_path / "ticks.parquet")["tick"].to_list() == list(range(9))


def test_a_metric_named_like_a_column_is_refused(tmp_path):
    class ReceivedPackets(Order):
        name = "received"

    metrics = Metrics([ReceivedPackets()])
    with pytest.raises(BadInput, check=lambda error: error.key == "metrics.received"):
        TickRecorder(tmp_path, metrics, StillClock()).begin(static(2))
