"""A run can be looked at, while it goes on and afterwards; what shows it ends with whoever asked for it."""

import contextlib
import re
import signal
import subprocess
import sys
import urllib.request

import psutil
import pytest

from swarmwire.comms.base.clock import WallClock
from swarmwire.deploy import run
from swarmwire.deploy.live import live_view, viewer
from swarmwire.deploy.live.drawing import Drawer
from swarmwire.deploy.live.live_view import LiveView
from swarmwire.deploy.live.page.web_viewer import viewer_code
from swarmwire.deploy.live.subscription import subscribe
from swarmwire.deploy.live.viewer import Viewer, ViewOptions, readable, show_recording
from swarmwire.deploy.runs.live_address import read_live
from swarmwire.deploy.runs.published import Published
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.pictures.viewer.program import closed_environment, end, free_port, is_open, viewer_path
from tests.support.clocks import until
from tests.support.deploy.page import family, kill_family, requested_hosts
from tests.support.deploy.runs import LOSSY, At, refused_command

rerun = pytest.importorskip("rerun", reason="needs the extra [view]")
pytest.importorskip("fastapi", reason="needs the extra [ui]")


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
        try:
            line = process.stderr.readline()
            match = re.search(r"http://127\.0\.0\.1:\d+/\S+/", line)
            assert match, line + process.stderr.read()
            yield process, match[0]
        finally:
            kill_family(process.pid)


def listening(pid):
    """The addresses at which a process and all its children listen."""
    sockets = [c for one in family(pid) for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
    return [socket.laddr.ip for socket in sockets]


def test_recording_without_an_end_is_shown_on_loopback_until_ctrl_c(folder, tmp_path):
    shown = tmp_path / "cut.rrd"
    shown.write_bytes((folder / "run.rrd").read_bytes()[:150_000])
    with viewing(shown) as (process, page):
        head = b"RRF2"  # how rerun's recordings begin
        assert urllib.request.urlopen(f"{page}run.rrd", timeout=20).read()[:4] == head
        assert listening(process.pid) == ["127.0.0.1"]
        assert len(family(process.pid)) == 1  # rerun has given its code, and ended
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0


def test_browser_requests_of_a_view_stay_on_this_machine(folder):
    """Rerun's own page asks fonts.googleapis.com, api.github.com, app.rerun.io and tel.rerun.io."""
    with viewing(folder / "run.rrd") as (_, page):
        assert requested_hosts(page) == {"127.0.0.1"}


RERUN = """
from swarmwire.comms.base.clock import WallClock
from swarmwire.deploy.live.viewer import rerun
with rerun(WallClock(), ["--serve-grpc"]) as (process, host, ports):
    print(process.pid, host, *ports, flush=True)
    input()
"""


@contextlib.contextmanager
def rerun_elsewhere():
    """Rerun's program as the child of a process, with what it said: its pid, its address and its port."""
    command = [sys.executable, "-c", RERUN]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:
        try:
            pid, host, port = parent.stdout.readline().split()
            yield parent, psutil.Process(int(pid)), host, int(port)
        finally:
            kill_family(parent.pid)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux ends a child with its parent")
def test_rerun_ends_with_a_killed_parent_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with rerun_elsewhere() as (parent, child, *_):
        parent.kill()
        until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has loopback addresses to choose from")
def test_rerun_listens_where_no_name_of_a_website_leads(monkeypatch):
    """Its port answers under any name, so a name that leads to 127.0.0.1 must not reach it."""
    with rerun_elsewhere() as (_, child, host, port):
        listens = {(c.laddr.ip, c.laddr.port) for c in child.net_connections("inet") if c.status == "LISTEN"}
        assert listens == {(host, port)}
        assert is_open(port, host)
        assert not is_open(port, "127.0.0.1")


def test_rerun_neither_reads_nor_writes_settings_of_the_user(tmp_path, monkeypatch):
    """It would note at its first start that it may send reports from the second on."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    code = viewer_code(WallClock())
    assert code["re_viewer_bg.wasm"][:4] == b"\0asm"
    assert b"wasm_bindgen" in code["re_viewer.js"]
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_view_in_a_browser_is_at_the_port_asked_for_if_it_is_free(folder, monkeypatch, capsys):
    port = free_port()
    with viewing(folder / "run.rrd", "--port", port) as (_, page):
        assert page.startswith(f"http://127.0.0.1:{port}/")
        refused_command(monkeypatch, capsys, "view", folder, "--port", str(port), match=f"--port: {port}: ")


def test_view_ends_with_its_window(folder, monkeypatch):
    looks = iter([True, True, False])

    @contextlib.contextmanager
    def window(*_):
        yield Viewer("", None, lambda: next(looks))

    monkeypatch.setattr(viewer, "window", window)
    show_recording(folder / "run.rrd", ViewOptions(WallClock(), print, lambda: False))
    assert not list(looks)


def batches_in(path):
    """The robots in a recording."""
    chunks = rerun.chunk.RrdReader(str(path)).stream().filter(content="/world/robots")
    return [chunk.to_record_batch() for chunk in chunks]


def test_recording_without_an_end_is_completed_in_a_copy(folder, tmp_path):
    good = folder / "run.rrd"
    with readable(good) as path:
        assert path == good
    cut = tmp_path / "cut.rrd"
    whole_bytes = good.read_bytes()
    cut.write_bytes(whole_bytes[: len(whole_bytes) * 2 // 3])
    with readable(cut) as path:
        assert path != cut
        verified = subprocess.run([viewer_path(), "rrd", "verify", path], capture_output=True, check=False)
        assert verified.returncode == 0, verified.stderr
        assert sum(batch.num_rows for batch in batches_in(path)) > 10
    assert not path.exists()
    assert cut.stat().st_size == len(whole_bytes) * 2 // 3


def live_run(folder, *observers, duration_s=3):
    """A run published in this folder, beside these observers."""
    metrics = Metrics()
    shown = Published(folder, "r", metrics, WallClock())
    return run(LOSSY, overrides=[f"duration_s={duration_s}"], observers=[metrics, shown, *observers])


def test_live_view_listens_on_loopback_and_its_death_leaves_the_run_alone(tmp_path, capfd):
    view, addresses, texts = LiveView(tmp_path, web=True), [], []

    def has_address():
        texts.append(capfd.readouterr().err)
        return "open http://127.0.0.1:" in "".join(texts)

    def look():
        until(has_address)
        addresses.extend(listening(view.pid))

    def kill():
        process = psutil.Process(view.pid)
        process.kill()
        process.wait(30)

    with view:
        beside = live_run(tmp_path, view, At(5, look), At(20, kill))
        view.wait()  # at once: it is gone
    assert addresses == ["127.0.0.1"]
    assert beside.trajectory_sha256 == run(LOSSY, overrides=["duration_s=3"]).trajectory_sha256
    assert not [name for name in beside.counts if name.startswith("observer_failed")]


@pytest.mark.parametrize("frozen", [False, True])
def test_live_view_ends_with_the_block_that_opened_it(tmp_path, monkeypatch, frozen):
    if frozen:
        monkeypatch.setattr(live_view, "EXIT_TIMEOUT_S", 0.2)
    view, processes = LiveView(tmp_path, web=True), []

    def look():
        until(lambda: listening(view.pid))
        processes.extend(family(view.pid))
        if frozen:
            for process in processes:
                process.suspend()

    with view:
        live_run(tmp_path, view, At(5, look))
    assert processes
    assert not [process for process in processes if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]


def test_live_view_that_cannot_be_opened_says_so_and_the_run_goes_on(tmp_path, monkeypatch, capsys):
    view = LiveView(tmp_path)
    monkeypatch.setattr(view, "_command", [str(tmp_path / "none")])
    with view:
        result = live_run(tmp_path, view, duration_s=1)
        view.wait()
    assert result.ticks == 10
    assert "no live view: " in capsys.readouterr().err


@contextlib.contextmanager
def hub(drawn, folder):
    """What draws into a program of rerun that only writes down what it is sent: no graphics are needed."""
    port = free_port()
    with (folder / "log").open("wb") as log:
        command = [viewer_path(), "--save", drawn, "--bind", "127.0.0.1", "--port", str(port)]
        process = subprocess.Popen(command, env=closed_environment(), stdout=log, stderr=log)
        try:
            until(lambda: is_open(port))
            yield f"rerun+http://127.0.0.1:{port}/proxy"
        finally:
            process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(10)
            end(process)


@contextlib.contextmanager
def parts(drawn, _):
    """What draws for browsers, whose parts one after another are a recording."""
    with drawn.open("wb") as file:
        yield file.write


@pytest.mark.parametrize("viewer_for", [hub, parts])
def test_published_run_is_drawn_in_the_viewer(tmp_path, viewer_for):
    drawn, clock = tmp_path / "drawn.rrd", WallClock()
    poses, held = {}, contextlib.ExitStack()

    class Follow(At):
        """Draws from tick 1 on, and keeps the poses."""

        def see(self, truth):
            super().see(truth)
            poses[truth.tick] = truth.pose[:, :2].astype("float32").tolist()

    with viewer_for(drawn, tmp_path) as target, held:

        def follow():
            run = held.enter_context(subscribe(read_live(tmp_path)))
            drawer = Drawer(run, target, ViewOptions(clock, print, lambda: False))
            drawer.start()
            held.callback(drawer.join)

        live_run(tmp_path, Follow(1, follow), duration_s=20)
    rows = {}
    with readable(drawn) as path:
        batches = batches_in(path)
    for batch in batches:
        if {"tick", "Points2D:positions"} <= set(batch.schema.names):
            rows.update(zip(batch["tick"].to_pylist(), batch["Points2D:positions"].to_pylist(), strict=True))
    shown = {tick: row for tick, row in rows.items() if row is not None}
    assert len(shown) >= 5
    assert all(row == poses[tick] for tick, row in shown.items())
