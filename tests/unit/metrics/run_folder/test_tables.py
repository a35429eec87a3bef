from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import Fate, Payloads
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.registry import standard_names
from swarmwire.metrics.measures.swarm.order import Order
from swarmwire.metrics.records.run_folder import packets as packets_table
from swarmwire.metrics.records.run_folder import ticks as ticks_table
from swarmwire.metrics.records.run_folder.events import EventLog, EventRecorder
from swarmwire.metrics.records.run_folder.packets import PacketRecorder, PacketSample
from swarmwire.metrics.records.run_folder.ticks import TickRecorder
from swarmwire.metrics.records.run_folder.writer import parts_of
from tests.support.clocks import StillClock
from tests.support.metrics.recorded import links, record, wandering
from tests.support.metrics.truths import edges, static, tally, truth
from tests.support.refusals import refused_input

FIELDS = {
    "pose": ("x_m", "y_m", "heading_rad"),
    "velocity": ("vx_mps", "vy_mps", "turn_radps"),
    "command": ("command_forward_mps", "command_turn_radps"),
}


def check(table, run, truths):
    """The table holds what was seen, motion to float32."""
    shape = (len(truths), run.arenas, run.robots)
    assert table["tick"].to_list() == [one.tick for one in truths for _ in range(run.arenas)]
    assert table["time_s"].to_list() == [one.tick / run.rate_hz for one in truths for _ in range(run.arenas)]
    assert table["arena"].to_list() == list(range(run.arenas)) * len(truths)
    assert table["seed"].to_list() == list(run.seeds) * len(truths)
    for field, columns in FIELDS.items():
        for index, column in enumerate(columns):
            expected = np.array([getattr(one, field)[:, index] for one in truths], np.float32)
            assert np.array_equal(np.array(table[column].to_list(), np.float32).reshape(shape), expected.reshape(shape))
    assert np.array_equal(
        np.array(table["alive"].to_list()).reshape(shape), np.array([one.alive for one in truths]).reshape(shape)
    )
    expected = [[one.states[code] for code in one.state] for one in truths]
    assert np.array_equal(np.array(table["state"].to_list()).reshape(shape), np.array(expected).reshape(shape))


@given(ticks=st.integers(1, 25), arenas=st.integers(1, 3), robots=st.integers(1, 4), in_chunk=st.integers(1, 9))
@settings(max_examples=15, deadline=None)
def test_ticks_come_back_however_they_were_cut_into_parts(tmp_path_factory, ticks, arenas, robots, in_chunk):
    folder, run = tmp_path_factory.mktemp("run"), static(robots, arenas=arenas)
    truths = list(wandering(run, ticks))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ticks_table, "MAX_TICKS", in_chunk)
        recorded = record(folder, run, truths)
    assert recorded["ticks"] == {"rows": ticks * arenas, "dropped": 0}
    check(pl.read_parquet(folder / "ticks.parquet"), run, truths)


def test_metrics_are_those_measured_and_null_where_undefined(tmp_path):
    run, metrics = static(3, arenas=2), Metrics()
    recorder = TickRecorder(tmp_path, metrics, StillClock())
    expected = {name: [] for name in standard_names()}
    for observer in (metrics, recorder):
        observer.begin(run)
    for tick in wandering(run, 12, edges=edges((0, 1), (4, 5))):
        for observer in (metrics, recorder):
            observer.see(tick)
        for name, values in metrics.latest.items():
            expected[name] += [None if np.isnan(value) else value for value in values]
    recorder.end(None)
    table = pl.read_parquet(tmp_path / "ticks.parquet")
    assert {name: table[name].to_list() for name in standard_names()} == expected
    assert table["target_best"].null_count() == 24  # there is no light


def test_radio_counts_are_those_of_the_tick_and_null_without_a_radio(tmp_path):
    run = static(3, arenas=2)
    counted = tally({Fate.RECEIVED: 2, Fate.LOST: 1, Fate.OUT_OF_RANGE: 4}, {Fate.RECEIVED: 3}, sent=7)
    record(tmp_path, run, [truth(run, 0), truth(run, 1, tally=counted)])
    table = pl.read_parquet(tmp_path / "ticks.parquet").select("sent", "received", "in_range")
    assert table.rows() == [(None,) * 3, (None,) * 3, (7, 2, 3), (7, 3, 3)]


def test_slow_run_writes_a_part_every_two_seconds(tmp_path):
    run, clock, metrics = static(2), StillClock(), Metrics()
    recorder = TickRecorder(tmp_path, metrics, clock)
    for observer in (metrics, recorder):
        observer.begin(run)
    parts = []
    original = recorder._writer.put
    recorder._writer.put = lambda chunk: parts.append(chunk.rows) or original(chunk)
    for tick in wandering(run, 9):
        clock.time_ns += 7 * NS_PER_S // 10
        for observer in (metrics, recorder):
            observer.see(tick)
    assert parts == [3, 3, 3]
    recorder.end(None)
    assert parts_of(tmp_path, "ticks") == []
    assert pl.read_parquet(tmp_path / "ticks.parquet")["tick"].to_list() == list(range(9))


def test_metric_named_like_a_column_is_refused(tmp_path):
    class ReceivedPackets(Order):
        name = "received"

    metrics = Metrics([ReceivedPackets()])
    with refused_input(key="metrics.received"):
        TickRecorder(tmp_path, metrics, StillClock()).begin(static(2))


TICK_NS = 100_000_000


def packets(folder):
    return pl.read_parquet(folder / "packets.parquet")


def test_packets_row_holds_all_fields_of_a_link(tmp_path):
    run = static(4)
    received = links([0, 2], [1, 3], [7, 8], TICK_NS, to=[-1, 3], rssi_dbm=np.array([-61.5, np.nan]))
    never = links(3, -1, 9, TICK_NS, fate=Fate.QUEUE_FULL, receivers=3, tag=0x0001)
    truths = [truth(run, 0), truth(run, 1), truth(run, 2, finished=received), truth(run, 3, finished=never)]
    recorded = record(tmp_path, run, truths, packets=1.0, topics={1: "Beacon"})
    assert recorded["packets"] == {"rows": 3, "dropped": 0, "share": 1.0}
    table = packets(tmp_path).drop("distance_m")
    times = (TICK_NS - 1, TICK_NS, TICK_NS + 1000)
    assert table.rows() == [
        (0, 0, 1, 1, None, 7, *times, "received", -61.5, 10, "0x1a2b", None),
        (0, 2, 3, 1, 3, 8, *times, "received", None, 10, "0x1a2b", None),
        (0, 3, None, 3, None, 9, *times, "queue_full", None, 10, "Beacon", None),
    ]


def test_packets_row_holds_the_payload_of_its_packet(tmp_path):
    run = static(4)
    both = replace(
        links([2, 0, 0], [1, 3, 2], [8, 7, 7], TICK_NS),
        payload=np.array([0, 2, 2]),
        payloads=Payloads.from_rows([b"first", b"nobody's", b"second"]),
    )
    unknown = links(3, 1, 9, TICK_NS)
    record(tmp_path, run, [truth(run, 0), truth(run, 1, finished=both), truth(run, 2, finished=unknown)], packets=1.0)
    assert packets(tmp_path)["payload"].to_list() == [b"first", b"second", b"second", None]


@pytest.mark.parametrize("in_chunk", [1, 100_000])
def test_packets_distance_is_that_of_the_tick_when_it_went_on_air(tmp_path, monkeypatch, in_chunk):
    monkeypatch.setattr(packets_table, "CHUNK_ROWS", in_chunk)
    run = static(2, arenas=2)
    poses = [np.zeros((4, 3)) for _ in range(5)]
    for tick, pose in enumerate(poses):
        pose[3, 0] = 1.0 + tick  # the second robot of arena 1
    on_air = {2: TICK_NS, 3: 2 * TICK_NS - 1, 4: 2 * TICK_NS}
    ended = {tick: links(0, 1, tick, at_ns, arena=1) for tick, at_ns in on_air.items()}
    record(tmp_path, run, [truth(run, t, pose=p, finished=ended.get(t)) for t, p in enumerate(poses)], packets=1.0)
    assert packets(tmp_path)["distance_m"].to_list() == [2.0, 2.0, 3.0]


def test_packets_distance_is_that_in_space(tmp_path):
    run, pose = static(2), np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    record(
        tmp_path,
        run,
        [truth(run, 0, pose=pose, height_m=np.array([1.0, 13.0]), finished=links(0, 1, 0, 0))],
        packets=1.0,
    )
    assert packets(tmp_path)["distance_m"].to_list() == [13.0]  # 3, 4 and 12 m


def test_packets_distance_is_null_after_too_long_a_flight(tmp_path, monkeypatch):
    monkeypatch.setattr(packets_table, "POSES_S", 0.2)
    monkeypatch.setattr(packets_table, "CHUNK_ROWS", 1)
    run = static(2)
    ended = {tick: links(0, 1, tick, 0) for tick in (1, 5, 8)}
    record(tmp_path, run, [truth(run, tick, finished=ended.get(tick)) for tick in range(9)], packets=1.0)
    assert packets(tmp_path)["distance_m"].to_list() == [0.0, 0.0, None]


def test_packet_sample_keeps_whole_packets_and_about_its_share():
    sender, sequence, receiver = (a.ravel() for a in np.meshgrid(np.arange(20), np.arange(500), np.arange(3)))
    sampled = PacketSample(0.1, (1, 2))(links(sender, receiver, sequence, 0))
    assert (sampled.reshape(500, 20, 3).any(axis=2) == sampled.reshape(500, 20, 3).all(axis=2)).all()
    # 10,000 packets: standard deviation 0.3 %; false alarm below 1e-6 of seeds, and the seed is fixed.
    assert abs(sampled.mean() - 0.1) < 0.015
    other = PacketSample(0.1, (1, 2))(links(sender, receiver, sequence, 0, arena=1))
    assert (sampled != other).any()
    assert np.array_equal(PacketSample(0.1, (2,))(links(sender, receiver, sequence, 0)), other)


def test_packet_sample_of_a_larger_share_contains_the_smaller():
    rows = links(np.arange(200), 0, 3, 0)
    few, more = (PacketSample(share, (1,))(rows) for share in (0.1, 0.6))
    assert (more | ~few).all()
    assert few.sum() < more.sum() < 200


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, float("nan")])
def test_packet_share_that_is_invalid_is_refused(tmp_path, share):
    with refused_input(key="packets"):
        PacketRecorder(tmp_path, StillClock(), share)


def test_packets_are_off_unless_asked_for(tmp_path):
    run = static(2)
    assert record(tmp_path, run, [truth(run)]).keys() == {"ticks", "events"}
    assert {path.name for path in tmp_path.iterdir()} == {"ticks.parquet", "events.parquet", "static.json"}


def test_event_has_a_row_in_each_arena_with_the_robots_it_changed(tmp_path):
    run = static(2, arenas=2)
    kill = EventRecord(0, 0.35, "kill", False, np.array([True, False, True, True]))
    over = EventRecord(0, 0.35, "kill", True, np.zeros(4, np.bool_))
    truths = [truth(run, 0), truth(run, 4, events=(kill,)), truth(run, 6, events=(over,))]
    assert record(tmp_path, run, truths)["events"] == {"rows": 4, "dropped": 0}
    assert pl.read_parquet(tmp_path / "events.parquet").rows() == [
        (0.35, 4, 0.4, "kill", "", False, 0, ["flock-0"]),
        (0.35, 4, 0.4, "kill", "", False, 1, ["flock-0", "flock-1"]),
        (0.35, 6, 0.6, "kill", "", True, 0, []),
        (0.35, 6, 0.6, "kill", "", True, 1, []),
    ]


def kill(*changed: bool, ended: bool = False) -> EventRecord:
    return EventRecord(0, 0.15, "kill", ended, np.array(changed))


def test_event_summary_names_the_robots_of_each_arena():
    log, run = EventLog(), static(2, arenas=2)
    log.begin(run)
    log.see(truth(run, 1))
    log.see(truth(run, 2, events=(kill(True, False, True, True), kill(False, True, False, False, ended=True))))
    first, second = log.end(None)["events"]
    robots = [["flock-0"], ["flock-0", "flock-1"]]
    expected = {"at_s": 0.15, "tick": 2, "do": "kill", "part": "", "ended": False, "singly": False, "robots": robots}
    assert first == expected
    assert (second["ended"], second["robots"]) == (True, [["flock-1"], []])


def broken(*changed: bool) -> EventRecord:
    return EventRecord(1, 0.2, "fail", False, np.array(changed), "motors", singly=True)


def test_fail_event_names_its_part():
    log, run = EventLog(), static(2)
    log.begin(run)
    log.see(truth(run, 2, events=(broken(True, False),)))
    (summary,) = log.end(None)["events"]
    assert (summary["do"], summary["part"], summary["singly"]) == ("fail", "motors", True)
    assert [event.words for event in (broken(True, True), kill(True, ended=True))] == ["fail motors", "kill ended"]


def test_event_of_single_robots_has_rows_only_of_arenas_it_changed(tmp_path):
    run, recorder = static(2, arenas=2), EventRecorder(tmp_path)
    recorder.begin(run)
    recorder.see(truth(run, 2, events=(broken(False, False, False, True), kill(True, False, False, False))))
    assert recorder.end(None)["record_events"]["rows"] == 3
    rows = pl.read_parquet(tmp_path / "events.parquet").select("do", "part", "arena", "robots").rows()
    assert rows == [("fail", "motors", 1, ["flock-1"]), ("kill", "", 0, ["flock-0"]), ("kill", "", 1, [])]
