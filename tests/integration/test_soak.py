"""A schedule of faults is played, and the checks of the soak find what must not be."""

import subprocess
import sys
from dataclasses import replace

import pytest

from swarmwire.world.backends.runner_reports import NOT_READY
from tests.support.deploy.runs import record_run
from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken
from tests.tools.soak.plan import draw
from tests.tools.soak.plays import play
from tests.tools.soak.samples import Sample, flatness

ROBOTS = ("a", "b")
JOINED = ("joined", "r0", ROBOTS, -1)
FLAT = Sample(0.0, "a world", 0, 400.0, 200.0, 60, 38, 0.0, 20.0, 0)


def test_schedule_is_drawn_from_its_seed_and_passes(tmp_path):
    plan = draw(8)
    assert plan == draw(8)
    assert (plan.family, bool(plan.faults)) == ("wait", True)
    assert all(play(plan, tmp_path))


def test_schedules_have_every_family_and_every_fault():
    plans = [draw(seed) for seed in range(1, 201)]
    assert {plan.family for plan in plans} == {
        "wait", "goes on", "real time", "own runners", "world killed", "campaign"
    }  # fmt: skip
    faults = {fault.kind for plan in plans for fault in plan.faults}
    assert faults == {"killed", "frozen", "frozen too long", "slowed", "leaves"}


def summary(*changes):
    """The part of a summary with these runner changes, each counted."""
    rows = [
        {"what": change, "runner": runner, "robots": robots, "tick": tick, "reason": reason[0] if reason else ""}
        for change, runner, robots, tick, *reason in changes
    ]
    kinds = [change for change, *_ in changes]
    return {
        "runner_events": rows,
        "counts": {"runners_lost": kinds.count("lost"), "runners_left": kinds.count("left")},
    }


def test_soak_finds_a_robot_of_two_runners_or_of_none():
    good = summary(JOINED, ("lost", "r0", ROBOTS, 4), ("joined", "r1", ("a",), 5), ("returned", "r0", ("b",), 6))
    assert invariants.check_owners(good, ROBOTS)
    assert invariants.check_owners(summary(JOINED, ("lost", "r0/1", ("b",), 4)), ROBOTS)  # a process of the host
    never_ready = ("lost", "r0", ROBOTS, 4), ("left", "r0", ROBOTS, 4, NOT_READY), ("returned", "r0", ROBOTS, 4)
    assert invariants.check_owners(summary(JOINED, *never_ready), ROBOTS)
    for changes in (
        (JOINED, ("joined", "r1", ("a",), 4)),  # taken twice
        (JOINED, ("lost", "r1", ("a",), 4)),  # of another runner
        (JOINED, ("lost", "r0", ("a",), 4), ("left", "r0", ("a",), 5)),  # gone twice
        (("joined", "r0", ("a",), -1), ("lost", "r0", ("a",), 4)),  # begins without an agent for b
    ):
        with pytest.raises(Broken):
            invariants.check_owners(summary(*changes), ROBOTS)
    with pytest.raises(Broken):
        invariants.check_owners({**summary(JOINED, ("lost", "r0", ROBOTS, 4)), "counts": {}}, ROBOTS)


def test_soak_finds_fates_that_do_not_add_up_and_crashes():
    assert invariants.check_fates({"radio": {"intended": 3, "fates": {"received": 2, "lost": 1}}})
    with pytest.raises(Broken):
        invariants.check_fates({"radio": {"intended": 3, "fates": {"received": 2}}})
    assert invariants.check_exit_codes({"r0": {"0": 3, "-9": 1}})
    with pytest.raises(Broken):
        invariants.check_exit_codes({"r0": {"0": 3, "-6": 1}})


def test_soak_finds_a_run_that_differs_and_a_missing_file(tmp_path):
    folder = tmp_path / "run"
    record_run(folder, overrides=["duration_s=0.5", "robots.flock.count=3"])
    for check in (invariants.check_folder, invariants.check_repeat, invariants.check_undisturbed):
        assert check(folder)
    scenario = folder / "scenario.toml"
    scenario.write_text(scenario.read_text().replace("loss = 0.3", "loss = 0.4"))
    (folder / "static.json").unlink()
    for check in (invariants.check_folder, invariants.check_repeat, invariants.check_undisturbed):
        with pytest.raises(Broken):
            check(folder)


def test_soak_finds_remaining_processes_and_files(tmp_path):
    command = (sys.executable, "-c", "input()")
    with subprocess.Popen(command, env={"TMPDIR": str(tmp_path)}, stdin=subprocess.PIPE) as process:
        with pytest.raises(Broken, match=f"left: {process.pid} "):
            invariants.check_no_process(tmp_path, 0)
        process.communicate(b"\n")
    assert invariants.check_no_process(tmp_path, 0)
    assert invariants.check_no_file(tmp_path)
    (tmp_path / "sw-1").mkdir()
    with pytest.raises(Broken):
        invariants.check_no_file(tmp_path)


@pytest.mark.parametrize(
    ("growth", "expected"),
    [({}, set()), ({"rss_mib": 0.01}, set()), ({"rss_mib": 0.1}, {"memory, MiB"}), ({"threads": 1}, {"threads"})],
)
def test_soak_finds_growth_over_an_hour(growth, expected):
    hour = [replace(FLAT, at_s=10.0 * n, tick=100 * n, cpu_s=3.0 * n) for n in range(361)]
    rows = [replace(s, **{key: getattr(s, key) + n * by for key, by in growth.items()}) for n, s in enumerate(hour)]
    assert {f.quantity for f in flatness({"a world": rows}, 3600.0) if not f.holds} == expected
