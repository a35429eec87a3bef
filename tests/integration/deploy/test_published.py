"""A run is published for observers, who cannot slow it, change it, or see what they should not."""

import os
import signal
import threading
from contextlib import ExitStack, nullcontext
from typing import Any

import numpy as np
import psutil
import pytest
import zenoh

from swarmwire.comms.base.clock import NS_PER_S, WallClock, to_s
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import Fate
from swarmwire.comms.wire.observer_frames import encode_truth
from swarmwire.comms.wire.sessions import open_observer, open_runner, unix_endpoint
from swarmwire.deploy import run
from swarmwire.deploy.live.subscription import RunGone, subscribe
from swarmwire.deploy.runs import backends, published
from swarmwire.deploy.runs.live_address import Live, read_live, write_live
from swarmwire.deploy.runs.published import Published
from swarmwire.metrics.measures.measure import Metrics
from tests.support.clocks import StillClock, until
from tests.support.deploy.runs import LOSSY, At, watcher
from tests.support.metrics.truths import edges, static, tally, truth

MANY = ["robots.flock.count=300", 'robots.flock.place={how="arena"}', "arena.size_m=[20,20]", "duration_s=6"]


@pytest.fixture
def every_tick(monkeypatch):
    """Every tick is due."""
    monkeypatch.setattr(published, "FRAMES_PER_S", NS_PER_S)


class PublishedRun:
    """A run that is published, and a subscription to it; it ends with the block."""

    def __init__(self, folder, run, clock=None):
        self.run, self.metrics = run, Metrics()
        self.observer = Published(folder, "r", self.metrics, clock or WallClock())
        self.metrics.begin(run)
        self.observer.begin(run)
        self._subscription = subscribe(live(folder))

    def __enter__(self):
        self.seen = self._subscription.__enter__()
        until(self.observer._find_viewer)
        return self

    def __exit__(self, *error):
        try:
            self._subscription.__exit__(*error)
        finally:
            self.observer.end(None)

    def tick(self, tick, **fields):
        """Let the run tick; the truth of it."""
        now = truth(self.run, tick, **fields)
        self.metrics.see(now)
        self.observer.see(now)
        return now

    def next(self) -> Any:
        """The next tick that the subscription gets."""
        return until(self.seen.next)


def live(folder):
    """The run that goes on in this folder."""
    run = read_live(folder)
    assert run is not None
    return run


def test_nobody_looks_on_and_nothing_is_encoded(tmp_path, monkeypatch, every_tick):
    monkeypatch.setattr(published, "encode_truth", None)  # to call it would be an error
    lives, look = [], At(3, lambda: lives.append(read_live(tmp_path)))
    observers = [metrics := Metrics(), shown := Published(tmp_path, "r", metrics, WallClock()), look]
    result = run(LOSSY, overrides=["duration_s=2"], observers=observers)
    assert (shown.frames, shown.left_out) == (0, 0)
    assert "observer_failed_Published" not in result.counts
    assert lives[0].pid == os.getpid()
    assert list(tmp_path.iterdir()) == []


def test_observer_gets_scene_ticks_and_metrics(tmp_path, every_tick):
    with PublishedRun(tmp_path, static(4, lights=[[]])) as published_run:
        seen, metrics = published_run.seen, published_run.metrics
        assert seen.scene.static == published_run.run
        assert [series.name for series in seen.metrics] == [metric.name for metric in metrics.metrics]
        for tick in range(5):
            now = published_run.tick(tick, pose=np.full((4, 3), tick / 7), edges=edges((0, 3)))
            got = published_run.next()
            assert (got.truth.tick, got.serial, got.ticks) == (tick, tick, 1)
            assert got.truth.pose.tolist() == now.pose.tolist()
            assert got.truth.edges.tolist() == [[0, 3]]
            for name, values in seen.latest.items():
                assert np.array_equal(values, metrics.latest[name], equal_nan=True)
        counts = published_run.observer.end(None)
        until(lambda: seen.next() or seen.over)
        assert seen.lost == seen.bad == 0
    assert counts == {"published": {"frames": 5, "left_out": 0}}


def test_frames_come_thirty_a_second_and_nothing_that_adds_up_is_lost_between(tmp_path):
    clock, glimpses = StillClock(), list[Any]()
    with PublishedRun(tmp_path, static(2), clock) as published_run:
        for tick in range(100):  # a hundredth of a second each
            kill = (EventRecord(tick, 0.0, "kill", False, np.ones(2, np.bool_)),) if tick == 50 else ()
            clock.time_ns += NS_PER_S // 100
            before = published_run.observer.frames
            published_run.tick(tick, tally=tally({Fate.RECEIVED: 2}), contact_onsets=np.array([[1, 0]]), events=kill)
            if published_run.observer.frames > before:
                glimpses.append(published_run.next())
    last = glimpses[-1].truth.tick
    assert len(glimpses) == 25  # every fourth tick is the first after a thirtieth of a second
    assert sum(glimpse.ticks for glimpse in glimpses) == last + 1
    assert sum(glimpse.truth.tally.fates[0, Fate.RECEIVED] for glimpse in glimpses) == 2 * (last + 1)
    assert sum(glimpse.truth.contact_onsets[0, 0] for glimpse in glimpses) == last + 1
    assert [event.serial for glimpse in glimpses for event in glimpse.truth.events] == [50]


def test_ticks_that_find_the_sender_busy_are_left_out_and_counted(tmp_path, monkeypatch, every_tick):
    go = threading.Event()
    monkeypatch.setattr(published, "encode_truth", lambda glimpse: go.wait(20.0) and encode_truth(glimpse))
    with PublishedRun(tmp_path, static(2)) as published_run:
        observer = published_run.observer
        for tick in range(20):
            published_run.tick(tick, tally=tally({Fate.RECEIVED: 1}))
        go.set()
        assert observer.frames + observer.left_out == 20
        assert 1 <= observer.frames <= 2
        got = [published_run.next() for _ in range(observer.frames)]
        until(observer._frames.empty)
        published_run.tick(20, tally=tally({Fate.RECEIVED: 1}))
        got.append(published_run.next())
        assert sum(glimpse.truth.tally.fates[0, Fate.RECEIVED] for glimpse in got if glimpse.truth.tally) == 21


def test_error_of_the_sender_ends_the_publishing_not_the_run(tmp_path, monkeypatch, every_tick):
    monkeypatch.setattr(published, "encode_truth", lambda _: 1 / 0)
    with PublishedRun(tmp_path, static(2)) as published_run:
        published_run.tick(0)
        until(lambda: published_run.observer._fault)
        with pytest.raises(ZeroDivisionError):
            published_run.observer.see(truth(published_run.run, 1))
    assert read_live(tmp_path) is None


@pytest.fixture(scope="module")
def alone():
    """The hash of the run that nobody looks on at."""
    return run(LOSSY, overrides=MANY).trajectory_sha256


@pytest.mark.parametrize(("number", "stays"), [(signal.SIGSTOP, True), (signal.SIGKILL, False)])
def test_run_is_the_same_beside_an_observer_that_is_frozen_or_killed(
    tmp_path, monkeypatch, every_tick, alone, number, stays
):
    puts, clock = [], WallClock()

    def timed(glimpse):
        puts.append(clock.now_ns())  # the put before this one is over
        return encode_truth(glimpse)

    monkeypatch.setattr(published, "encode_truth", timed)
    metrics = Metrics()
    shown = Published(tmp_path, "r", metrics, clock)
    with ExitStack() as held:
        watchers = []
        start = At(2, lambda: watchers.append(held.enter_context(watcher(tmp_path))))
        hit = At(5, lambda: watchers[0].send_signal(number))
        beside = run(LOSSY, overrides=MANY, observers=[metrics, shown, start, hit])
        state = psutil.Process(watchers[0].pid).status() if stays else psutil.STATUS_STOPPED
        assert state == psutil.STATUS_STOPPED  # it looked on, frozen, to the end
    assert beside.trajectory_sha256 == alone
    assert not [name for name in beside.counts if name.startswith("observer_failed")]
    if stays:
        # 1.3 MB and more: the socket and zenoh's queues hold less. A put that blocks would take 5 s.
        assert shown.frames + shown.left_out >= 50
        assert max(np.diff(puts)) < 2 * NS_PER_S, [to_s(int(gap)) for gap in np.diff(puts)]
    else:
        assert shown.frames < 50  # nothing is sent to the dead


def test_runners_see_no_truth_and_observers_nothing_of_the_runners(tmp_path, monkeypatch):
    metrics = Metrics()
    shown, received = Published(tmp_path, "r", metrics, WallClock()), {}
    at = unix_endpoint(str(tmp_path / "s"))
    monkeypatch.setattr(backends, "local_endpoint", lambda: nullcontext(at))
    with ExitStack() as held:

        def listen():
            sides = {"runners": open_runner(at), "observers": open_observer(live(tmp_path).endpoint)}
            for side, session in sides.items():
                held.enter_context(session)
                received[side] = session.declare_subscriber("swarmwire/**", zenoh.handlers.RingChannel(500))

        # A subscriber to everything is one to the truth, so the run is published.
        result = run(LOSSY, overrides=["duration_s=4"], runners=2, observers=[metrics, shown, At(1, listen)])
        samples = {side: [channel.try_recv() for _ in range(500)] for side, channel in received.items()}
        keys = {side: {str(got.key_expr).split("/")[2] for got in every if got} for side, every in samples.items()}
    assert result.ticks == 40
    assert keys == {"runners": {"frame", "answer"}, "observers": {"truth"}}


def test_published_run_listens_on_no_network(tmp_path):
    def listening():
        return [c for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN]

    before = listening()  # of the tests' own tools
    with PublishedRun(tmp_path, static(2)):
        assert live(tmp_path).endpoint.startswith("unixsock-stream/")
        assert listening() == before


def test_live_file_of_a_killed_run_is_not_believed(tmp_path):
    write_live(Live("unixsock-stream//nowhere", "r", 2**22 + 1), tmp_path)  # more than Linux gives out
    assert read_live(tmp_path) is None
    write_live(Live(f"unixsock-stream/{tmp_path}/none", "r", os.getpid()), tmp_path)
    with pytest.raises(RunGone, match="cannot be reached"), subscribe(read_live(tmp_path)):
        pass


def test_paused_run_shows_its_newest_tick_to_each_new_observer(tmp_path):
    metrics, ticks = Metrics(), []
    shown = Published(tmp_path, "r", metrics, WallClock())

    def looked(run):
        shown.catch_up()  # as the loop does for as long as it is held
        return run.next()

    def pause():
        for _ in range(2):  # the second begins to look on in the middle, after the first has gone
            with subscribe(read_live(tmp_path)) as run:
                glimpse = until(lambda run=run: looked(run))
                ticks.append(glimpse.truth.tick)
            until(lambda: shown.catch_up() or not shown._has_viewer)

    run(LOSSY, overrides=["duration_s=1"], observers=[metrics, shown, At(5, pause)])
    assert ticks == [5, 5]
