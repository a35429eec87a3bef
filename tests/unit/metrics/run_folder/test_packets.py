"""The tables of packets and of events."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import Fate, Payloads
from swarmwire.comms.truth import EventRecord
from swarmwire.metrics.run_folder import packets as packets_table
from swarmwire.metrics.run_folder.events import EventLog, EventRecorder
from swarmwire.metrics.run_folder.packets import PacketRecorder, PacketSample
from tests.support.clocks import StillClock
from tests.support.metrics.recorded import links, record
from tests.support.metrics.truths import static, truth

TICK_NS = 100_000_000


def packets(folder):
    return pl.read_parquet(folder / "packets.parquet")


def test_a_row_holds_all_that_is_known_of_a_link(tmp_path):
    of = static(4)
    received = links([0, 2], [1, 3], [7, 8], TICK_NS, to=[-1, 3], rssi_dbm=np.array([-61.5, np.nan]))
    never = links(3, -1, 9, TICK_NS, fate=Fate.QUEUE_FULL, receivers=3, tag=0x0001)
    seen = [truth(of, 0), truth(of, 1), truth(of, 2, finished=received), truth(of, 3, finished=never)]
    recorded = record(tmp_path, of, seen, packets=1.0, topics={1: "Beacon"})
    assert recorded["packets"] == {"rows": 3, "dropped": 0, "share": 1.0}
    table = packets(tmp_path).drop("distance_m")
    times = (TICK_NS - 1, TICK_NS, TICK_NS + 1000)
    assert table.rows() == [
        (0, 0, 1, 1, None, 7, *times, "received", -61.5, 10, "0x1a2b", None),
        (0, 2, 3, 1, 3, 8, *times, "received", None, 10, "0x1a2b", None),
        (0, 3, None, 3, None, 9, *times, "queue_full", None, 10, "Beacon", None),
    ]


def test_a_row_holds_the_bytes_of_its_packet(tmp_path):
    of = static(4)
    both = replace(
        links([2, 0, 0], [1, 3, 2], [8, 7, 7], TICK_NS),
        payload=np.array([0, 2, 2]),
        payloads=Payloads.of([b"first", b"nobody's", b"second"]),
    )
    unknown = links(3, 1, 9, TICK_NS)
    record(tmp_path, of, [truth(of, 0), truth(of, 1, finished=both), truth(of, 2, finished=unknown)], packets=1.0)
    assert packets(tmp_path)["payload"].to_list() == [b"first", b"second", b"second", None]


@pytest.mark.parametrize("in_chunk", [1, 100_000])
def test_the_distance_is_that_of_the_tick_in_which_it_went_on_air(tmp_path, monkeypatch, in_chunk):
    monkeypatch.setattr(packets_table, "CHUNK_ROWS", in_chunk)
    of = static(2, arenas=2)
    poses = [np.zeros((4, 3)) for _ in range(5)]
    for tick, pose in enumerate(poses):
        pose[3, 0] = 1.0 + tick  # the second robot of arena 1
    on_air = {2: TICK_NS, 3: 2 * TICK_NS - 1, 4: 2 * TICK_NS}
    ended = {tick: links(0, 1, tick, at_ns, arena=1) for tick, at_ns in on_air.items()}
    record(tmp_path, of, [truth(of, t, pose=p, finished=ended.get(t)) for t, p in enumerate(poses)], packets=1.0)
    assert packets(tmp_path)["distance_m"].to_list() == [2.0, 2.0, 3.0]


def test_the_distance_of_a_packet_that_took_too_long_is_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr(packets_table, "POSES_KEPT_S", 0.2)
    monkeypatch.setattr(packets_table, "CHUNK_ROWS", 1)
    of = static(2)
    ended = {tick: links(0, 1, tick, 0) for tick in (1, 5, 8)}
    record(tmp_path, of, [truth(of, tick, finished=ended.get(tick)) for tick in range(9)], packets=1.0)
    assert packets(tmp_path)["distance_m"].to_list() == [0.0, 0.0, None]


def test_a_sample_keeps_whole_packets_and_about_its_share():
    sender, sequence, receiver = (a.ravel() for a in np.meshgrid(np.arange(20), np.arange(500), np.arange(3)))
    kept = PacketSample(0.1, (1, 2))(links(sender, receiver, sequence, 0))
    assert (kept.reshape(500, 20, 3).any(axis=2) == kept.reshape(500, 20, 3).all(axis=2)).all()
    # 10,000 packets: standard deviation 0.3 %; false alarm below 1e-6 of seeds, and the seed is fixed.
    assert abs(kept.mean() - 0.1) < 0.015
    other = PacketSample(0.1, (1, 2))(links(sender, receiver, sequence, 0, arena=1))
    assert (kept != other).any()
    assert np.array_equal(PacketSample(0.1, (2,))(links(sender, receiver, sequence, 0)), other)


def test_a_larger_share_keeps_what_a_smaller_one_does():
    rows = links(np.arange(200), 0, 3, 0)
    few, more = (PacketSample(share, (1,))(rows) for share in (0.1, 0.6))
    assert (more | ~few).all()
    assert few.sum() < more.sum() < 200


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, float("nan")])
def test_a_share_that_is_none_is_refused(tmp_path, share):
    with pytest.raises(BadInput, check=lambda error: error.key == "packets"):
        PacketRecorder(tmp_path, StillClock(), share)


def test_packets_are_off_unless_asked_for(tmp_path):
    of = static(2)
    assert record(tmp_path, of, [truth(of)]).keys() == {"ticks", "events"}
    assert {path.name for path in tmp_path.iterdir()} == {"ticks.parquet", "events.parquet", "static.json"}


def test_an_event_has_a_row_in_each_arena_with_the_robots_it_changed(tmp_path):
    of = static(2, arenas=2)
    kill = EventRecord(0, 0.35, "kill", False, np.array([True, False, True, True]))
    over = EventRecord(0, 0.35, "kill", True, np.zeros(4, np.bool_))
    seen = [truth(of, 0), truth(of, 4, events=(kill,)), truth(of, 6, events=(over,))]
    assert record(tmp_path, of, seen)["events"] == {"rows": 4, "dropped": 0}
    assert pl.read_parquet(tmp_path / "events.parquet").rows() == [
        (0.35, 4, 0.4, "kill", "", False, 0, ["flock-0"]),
        (0.35, 4, 0.4, "kill", "", False, 1, ["flock-0", "flock-1"]),
        (0.35, 6, 0.6, "kill", "", True, 0, []),
        (0.35, 6, 0.6, "kill", "", True, 1, []),
    ]


def kill(*changed: bool, ended: bool = False) -> EventRecord:
    return EventRecord(0, 0.15, "kill", ended, np.array(changed))


def test_the_summary_names_the_robots_of_each_arena():
    log, of = EventLog(), static(2, arenas=2)
    log.begin(of)
    log.see(truth(of, 1))
    log.see(truth(of, 2, events=(kill(True, False, True, True), kill(False, True, False, False, ended=True))))
    first, second = log.end(None)["events"]
    robots = [["flock-0"], ["flock-0", "flock-1"]]
    expected = {"at_s": 0.15, "tick": 2, "do": "kill", "part": "", "ended": False, "singly": False, "robots": robots}
    assert first == expected
    assert (second["ended"], second["robots"]) == (True, [["flock-1"], []])


def broken(*changed: bool) -> EventRecord:
    return EventRecord(1, 0.2, "fail", False, np.array(changed), "motors", singly=True)


def test_what_failed_is_told_with_its_part():
    log, of = EventLog(), static(2)
    log.begin(of)
    log.see(truth(of, 2, events=(broken(True, False),)))
    (told,) = log.end(None)["events"]
    assert (told["do"], told["part"], told["singly"]) == ("fail", "motors", True)
    assert [event.words for event in (broken(True, True), kill(True, ended=True))] == ["fail motors", "kill ended"]


def test_what_happens_singly_has_rows_of_those_arenas_alone_in_which_somebody_changed(tmp_path):
    of, recorder = static(2, arenas=2), EventRecorder(tmp_path)
    recorder.begin(of)
    recorder.see(truth(of, 2, events=(broken(False, False, False, True), kill(True, False, False, False))))
    assert recorder.end(None)["record_events"]["rows"] == 3
    rows = pl.read_parquet(tmp_path / "events.parquet").select("do", "part", "arena", "robots").rows()
    assert rows == [("fail", "motors", 1, ["flock-1"]), ("kill", "", 0, ["flock-0"]), ("kill", "", 1, [])]
