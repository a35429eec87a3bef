"""A run can be looked at, while it goes on and afterwards; what shows it ends with whoever asked for it."""

import contextlib
import re
import signal
import subprocess
import sys
import urllib.request

import psutil
import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from swarmwire.deploy.live import live_view, viewer
from swarmwire.deploy.live.following import following, read_live
from swarmwire.deploy.live.live_view import LiveView
from swarmwire.deploy.live.published import Published
from swarmwire.deploy.live.viewer import Drawer, ViewOptions, whole
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.viewer.screenshot import end, free_port, is_open, program
from tests.support.clocks import until
from tests.support.deploy.runs import LOSSY, At

rerun = pytest.importorskip("rerun", reason="needs the extra [view]")


@pytest.fixture(autouse=True)
def _quiet(monkeypatch):
    """The command says so to rerun by an environment variable, which should not outlive a test."""
    monkeypatch.setenv("RUST_LOG", "off")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run that is over."""
    out = tmp_path_factory.mktemp("runs") / "done"
    run(LOSSY, overrides=["duration_s=3"], out=out)
    return out


@contextlib.contextmanager
def viewing(*arguments):
    """`swarmwire view` in a browser, once it has said where, with that address."""
    command = [sys.executable, "-m", "swarmwire.deploy", "view", "--web", *map(str, arguments)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            said = process.stderr.readline()
            found = re.search(r"http://127\.0\.0\.1:\d+/\?url=\S+", said)
            assert found, said + process.stderr.read()
            yield process, found[0]
        finally:
            for one in reversed([process, *family(process)]):
                with contextlib.suppress(psutil.NoSuchProcess):
                    one.kill()


def family(process):
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(process.pid).children(recursive=True)
    return []


def listening(pid):
    """The addresses at which a process and all its children listen."""
    processes = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    sockets = [c for one in processes for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
    return [socket.laddr.ip for socket in sockets]


def test_a_recording_without_an_end_is_shown_on_loopback_until_ctrl_c(folder, tmp_path):
    shown = tmp_path / "cut.rrd"
    shown.write_bytes((folder / "run.rrd").read_bytes()[:150_000])
    with viewing(shown) as (process, page):
        assert b"rerun" in urllib.request.urlopen(page, timeout=20).read().lower()
        addresses = listening(process.pid)
        children = family(process)
        assert len(addresses) >= 2
        assert set(addresses) <= {"127.0.0.1", "::1"}
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        assert not [child for child in children if child.is_running()]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux ends a child with its parent")
def test_a_view_that_is_killed_leaves_no_viewer_and_no_file(folder, tmp_path, monkeypatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    with viewing(folder / "run.rrd") as (process, _):
        [child] = family(process)
        process.kill()
        until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
    assert not list(temporary.iterdir())


def test_the_page_is_at_the_port_asked_for_and_the_view_ends_with_its_viewer(folder):
    port = free_port()
    with viewing(folder / "run.rrd", "--port", port) as (process, page):
        assert page.startswith(f"http://127.0.0.1:{port}/")
        taken = f"--port: {port}: "
        with pytest.raises(BadInput, match=taken), viewer.viewer(WallClock(), None, web=True, web_port=port):
            pass
        [child] = family(process)
        child.terminate()
        assert process.wait(30) == 0


def test_a_recording_without_an_end_is_completed_in_a_copy(folder, tmp_path):
    good = folder / "run.rrd"
    with whole(good) as path:
        assert path == good
    cut = tmp_path / "cut.rrd"
    whole_bytes = good.read_bytes()
    cut.write_bytes(whole_bytes[: len(whole_bytes) * 2 // 3])
    with whole(cut) as path:
        assert path != cut
        verified = subprocess.run([program(), "rrd", "verify", path], capture_output=True, check=False)
        assert verified.returncode == 0, verified.stderr
        ticks = [c.to_record_batch() for c in rerun.chunk.RrdReader(str(path)).stream().filter(content="/world/robots")]
        assert sum(batch.num_rows for batch in ticks) > 10
    assert not path.exists()
    assert cut.stat().st_size == len(whole_bytes) * 2 // 3


def live_run(folder, *observers, duration_s=3):
    """A run published in this folder, beside these observers."""
    metrics = Metrics()
    shown = Published(folder, "r", metrics, WallClock())
    return run(LOSSY, overrides=[f"duration_s={duration_s}"], observers=[metrics, shown, *observers])


def test_a_live_view_listens_on_loopback_and_the_run_does_not_notice_its_death(tmp_path, capfd):
    view, addresses, family, told = LiveView(tmp_path, web=True), [], [], []

    def told_where():
        told.append(capfd.readouterr().err)
        return "open http://127.0.0.1:" in "".join(told)

    def look():
        until(told_where)
        until(lambda: len(listening(view.pid)) >= 2)
        addresses.extend(listening(view.pid))
        family.extend(psutil.Process(view.pid).children(recursive=True))

    def kill():
        for process in family:
            process.kill()
        psutil.Process(view.pid).wait(30)

    with view:
        beside = live_run(tmp_path, view, At(5, look), At(20, kill))
        view.wait()  # at once: it noticed that its viewer is gone
    assert set(addresses) <= {"127.0.0.1", "::1"}
    assert family
    assert beside.trajectory_sha256 == run(LOSSY, overrides=["duration_s=3"]).trajectory_sha256
    assert not [name for name in beside.counts if name.startswith("observer_failed")]


@pytest.mark.parametrize("frozen", [False, True])
def test_a_live_view_ends_with_the_block_that_opened_it(tmp_path, monkeypatch, frozen):
    if frozen:
        monkeypatch.setattr(live_view, "LEAVE_S", 0.2)
    view, family = LiveView(tmp_path, web=True), []

    def look():
        until(lambda: len(listening(view.pid)) >= 2)
        family.extend([psutil.Process(view.pid), *psutil.Process(view.pid).children(recursive=True)])
        if frozen:
            for process in family:
                process.suspend()

    with view:
        live_run(tmp_path, view, At(5, look))
    assert len(family) >= 2
    assert not [process for process in family if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]


def test_a_live_view_that_cannot_be_opened_says_so_and_the_run_goes_on(tmp_path, monkeypatch, capsys):
    view = LiveView(tmp_path)
    monkeypatch.setattr(view, "_command", [str(tmp_path / "none")])
    with view:
        result = live_run(tmp_path, view, duration_s=1)
        view.wait()
    assert result.ticks == 10
    assert "no live view: " in capsys.readouterr().err


def test_what_a_run_publishes_is_drawn_in_the_viewer(tmp_path):
    """In one that only writes down what it is sent: no graphics are needed."""
    port, drawn, clock = free_port(), tmp_path / "drawn.rrd", WallClock()
    log = (tmp_path / "log").open("wb")
    hub = subprocess.Popen(
        [program(), "--save", drawn, "--bind", "127.0.0.1", "--port", str(port)], stdout=log, stderr=log
    )
    poses, held = {}, contextlib.ExitStack()

    class Follow(At):
        """Draws from tick 1 on, and keeps the poses."""

        def see(self, truth):
            super().see(truth)
            poses[truth.tick] = truth.pose[:, :2].astype("float32").tolist()

    def follow():
        seen = held.enter_context(following(read_live(tmp_path)))
        drawer = Drawer(seen, f"rerun+http://127.0.0.1:{port}/proxy", ViewOptions(clock, print, lambda: False))
        drawer.start()
        held.callback(drawer.join)

    try:
        until(lambda: is_open(port))
        with held:
            live_run(tmp_path, Follow(1, follow), duration_s=20)
    finally:
        hub.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            hub.wait(10)
        end(hub)
        log.close()
    rows = {}
    with whole(drawn) as path:
        batches = [
            c.to_record_batch() for c in rerun.chunk.RrdReader(str(path)).stream().filter(content="/world/robots")
        ]
    for batch in batches:
        if {"tick", "Points2D:positions"} <= set(batch.schema.names):
            rows.update(zip(batch["tick"].to_pylist(), batch["Points2D:positions"].to_pylist(), strict=True))
    shown = {tick: row for tick, row in rows.items() if row is not None}
    assert len(shown) >= 5
    assert all(row == poses[tick] for tick, row in shown.items())
