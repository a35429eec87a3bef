"""What a run leaves that was killed by SIGKILL: readable up to its last part, and true as far as it goes."""

import re
from importlib.util import find_spec

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.clock import NS_PER_S, WallClock
from swarmwire.metrics.record.part_files import part_file, parts_of
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.finding import State
from swarmwire.metrics.verify.recording_check import check_recording
from swarmwire.metrics.verify.verify import verify
from tests.support.deploy.commands import swarmwire
from tests.support.deploy.recorded import record_run, started

DURATION = "duration_s=20"
TICKS = 200
KILL = 'events=[{at_s=1.0, do="kill", robots={group="flock", share=0.2}}]'
# At random moments (fixed seed), and while the parts are joined.
MOMENTS = [*np.random.default_rng(17).integers(0, TICKS, 3).tolist(), "ends"]


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
        assert findings[name].state in (State.PARTIAL, State.WHOLE), findings[name]
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
    """A long run's folder, killed amid its ticks; a tick that was over two seconds before, and the last that was."""
    folder, clock = tmp_path_factory.mktemp("killed"), WallClock()
    process = started(folder, "duration_s=3600", rrd=find_spec("rerun") is not None)
    before, due_ns, seen = None, 0, list[int]()
    with process:
        assert process.stdout is not None
        ticks = (int(line) for line in process.stdout if line.strip().isdecimal())
        for tick in ticks:
            seen.append(tick)
            if before is None and len(parts_of(folder, "ticks")) >= 3:
                before, due_ns = tick, clock.now_ns() + 2 * NS_PER_S
            if before is not None and clock.now_ns() >= due_ns:
                break
        process.kill()
        return folder, before, max(*seen, *ticks)


def test_a_killed_run_leaves_its_recording_up_to_two_seconds_before(killed):
    pytest.importorskip("rerun", reason="needs the extra [view]")
    folder, before, last = killed
    state, told = check_recording(folder / "run.rrd")
    assert state is State.PARTIAL
    reach = re.search(r"readable up to tick (\d+); it was never closed$", told)
    assert reach, told
    assert before <= int(reach[1]) <= last + 1  # the recorder sees a tick before it is printed


def test_verify_tells_how_far_a_killed_run_came(killed):
    folder, *_ = killed
    last = pl.scan_parquet(parts_of(folder, "ticks")).select(pl.col("tick").max()).collect().item()
    told = swarmwire("verify", folder)
    assert (told.returncode, told.stderr) == (1, "")
    assert f"up to tick {last}" in " ".join(told.stdout.split())
    closing = told.stdout.strip().splitlines()[-1]
    assert closing.startswith("not whole: summary.json missing, ticks partial")


def test_verify_is_content_with_a_whole_run_and_refuses_what_is_none(whole, tmp_path):
    told = swarmwire("verify", whole.path)
    assert (told.returncode, told.stderr) == (0, "")
    assert told.stdout.strip().splitlines()[-1].startswith("whole: ")
    none = swarmwire("verify", tmp_path)
    assert none.returncode == 2
    assert none.stderr.splitlines() == [
        f"error: {tmp_path}: expected a run folder; there is nothing of a run in it",
    ]
