"""What a run leaves that was killed by SIGKILL: readable up to its last part, and true as far as it goes."""

import re
from importlib.util import find_spec

import polars as pl
import pytest

from swarmwire.comms.clock import NS_PER_S, WallClock
from swarmwire.metrics.run_folder.reader import RunFolder
from swarmwire.metrics.run_folder.recording_check import check_recording
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from swarmwire.metrics.run_folder.writer import part_file, parts_of
from tests.support.deploy.commands import called
from tests.support.deploy.recorded import record_run, started

DURATION = "duration_s=12"
KILL = 'events=[{at_s=1.0, do="kill", robots={group="flock", share=0.2}}]'
SOME_PERIODS_NS = NS_PER_S // 2  # a recorder's period of two seconds lasts 40 ms here
MOMENTS = [57, "ends"]  # amid its ticks, and while the parts are joined


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The same run, not killed."""
    folder = tmp_path_factory.mktemp("whole")
    record_run(folder, overrides=[DURATION, KILL])
    return RunFolder(folder)


@pytest.mark.parametrize("moment", MOMENTS)
def test_what_a_killed_run_left_is_readable_and_true(tmp_path, whole, moment):
    process = started(tmp_path, DURATION, KILL)
    with process:
        assert process.stdout is not None
        assert any(line.strip() == str(moment) for line in process.stdout)
        process.kill()
    folder = RunFolder(tmp_path)
    assert folder.summary is None
    assert folder.static == whole.static
    findings = {finding.part: finding for finding in verify(tmp_path)}
    for name in ("ticks", "packets", "events"):
        assert findings[name].state in (State.PARTIAL, State.INTACT), findings[name]
        parts = parts_of(tmp_path, name)
        assert parts == [part_file(tmp_path, name, number) for number in range(len(parts))] or folder.files(name)
        if folder.files(name) or name != "ticks":
            left = getattr(folder, name)()
            assert left.equals(getattr(whole, name)().head(len(left)))
    if folder.files("ticks"):
        ticks = folder.ticks(0)["tick"].to_list()
        assert ticks == list(range(len(ticks)))
        assert len(folder.robots()) == len(ticks) * whole.static.robots


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A long run's folder, killed amid its ticks; a tick that was over some periods before, and the last that was."""
    folder, clock = tmp_path_factory.mktemp("killed"), WallClock()
    process = started(folder, "duration_s=3600", rrd=find_spec("rerun") is not None)
    before, due_ns, seen = None, 0, list[int]()
    with process:
        assert process.stdout is not None
        ticks = (int(line) for line in process.stdout if line.strip().isdecimal())
        for tick in ticks:
            seen.append(tick)
            if before is None and len(parts_of(folder, "ticks")) >= 3:
                before, due_ns = tick, clock.now_ns() + SOME_PERIODS_NS
            if before is not None and clock.now_ns() >= due_ns:
                break
        process.kill()
        return folder, before, max(*seen, *ticks)


def test_a_killed_run_leaves_its_recording_up_to_the_last_period(killed):
    pytest.importorskip("rerun", reason="needs the extra [view]")
    folder, before, last = killed
    state, told = check_recording(folder / "run.rrd")
    assert state is State.PARTIAL
    reach = re.search(r"readable up to tick (\d+); it was never closed$", told)
    assert reach, told
    assert before <= int(reach[1]) <= last + 1  # the recorder sees a tick before it is printed


def test_verify_tells_how_far_a_killed_run_came(killed, monkeypatch, capsys):
    folder, *_ = killed
    last = pl.scan_parquet(parts_of(folder, "ticks")).select(pl.col("tick").max()).collect().item()
    code, out, errors = called(monkeypatch, capsys, "verify", folder)
    assert (code, errors) == (1, "")
    assert f"up to tick {last}" in " ".join(out.split())
    last = out.strip().splitlines()[-1]
    assert last.startswith("not intact: ")
    assert "summary.json missing, ticks partial" in last


def test_verify_is_content_with_a_whole_run_and_refuses_what_is_none(whole, tmp_path, monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "verify", whole.path)
    assert (code, errors) == (0, "")
    assert out.strip().splitlines()[-1].startswith("intact: ")
    code, _, errors = called(monkeypatch, capsys, "verify", tmp_path)
    assert (code, errors.count("\n")) == (2, 1)
    assert errors.startswith(f"error: {tmp_path}: ")
