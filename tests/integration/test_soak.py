"""Schedules of faults are played, and the checks of the soak find what must not be.

With HYPOTHESIS_PROFILE=soak, as in `make soak`, there are up to a hundred schedules of a kind.
"""

import subprocess
import sys
from random import Random  # noqa: TID251 - as Hypothesis gives to the rules
from typing import Any

import polars as pl
import pytest
from hypothesis import Phase, settings
from hypothesis.stateful import run_state_machine_as_test

from swarmwire.world.backends.runner_reports import NOT_READY
from tests.support.deploy.runs import record_run
from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken
from tests.tools.soak.samples import growths
from tests.tools.soak.schedules import JoinedRunners, KilledCampaign, StartedRunners

ROBOTS = ("a", "b")
JOINED = ("joined", "r0", ROBOTS, -1)
FLAT = {"process_name": "a world", "rss_mib": 400.0, "descriptors": 60, "threads": 38, "tick_ms": 20.0}


PROFILE = settings.get_current_profile_name()


@pytest.mark.skipif(PROFILE != "soak", reason="takes half an hour")
@pytest.mark.timeout(0)
@pytest.mark.parametrize(
    ("machine", "steps", "schedules"), [(JoinedRunners, 8, 120), (StartedRunners, 6, 40), (KilledCampaign, 3, 20)]
)
def test_accounts_hold_in_each_schedule_of_faults(machine: Any, steps: int, schedules: int) -> None:
    phases = (Phase.generate, Phase.shrink)
    run_state_machine_as_test(
        machine, settings=settings(max_examples=schedules, stateful_step_count=steps, phases=phases)
    )


def test_accounts_hold_while_runners_are_lost():
    schedule = JoinedRunners()
    schedule.start_world("wait", {3}, 0, has_router=False, in_real_time=False, ending="SIGTERM")
    for trouble in ("runner_killed", "runner_frozen_too_long", "agent_killed"):
        schedule.disturb_runner(trouble, Random(1))
        schedule.accounts_go_on()
    schedule.disturb_world("world_frozen", Random(1))
    schedule.disturb_observer("observer_killed", Random(1))
    schedule.teardown()


def test_accounts_hold_after_a_run_is_killed():
    schedule = StartedRunners()
    schedule.start_run("coast", 2, ending="SIGKILL")
    schedule.disturb_runner("runner_leaves", Random(1))
    schedule.disturb_world("loss_set", Random(1))
    schedule.teardown()


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
    before_ready = ("lost", "r0", ROBOTS, 4), ("restarted", "r0/0", ("a",), 4), ("returned", "r0", ROBOTS, 4)
    assert invariants.check_owners(summary(JOINED, *before_ready), ROBOTS)
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
            invariants.check_no_process(tmp_path)
        process.communicate(b"\n")
    assert invariants.check_no_process(tmp_path)
    assert invariants.check_no_file(tmp_path)
    (tmp_path / "sw-1").mkdir()
    with pytest.raises(Broken):
        invariants.check_no_file(tmp_path)


@pytest.mark.parametrize(
    ("growth", "expected"),
    [
        ({}, set()),
        ({"rss_mib": 0.01}, set()),
        ({"rss_mib": 0.1}, {"memory, MiB"}),
        ({"threads": 1}, {"threads"}),
    ],
)
def test_soak_finds_growth_over_an_hour(growth, expected):
    hour = [{**FLAT, "at_s": 10.0 * n, "tick": 100 * n, "cpu_s": 3.0 * n} for n in range(361)]
    rows = [row | {name: row[name] + n * by for name, by in growth.items()} for n, row in enumerate(hour)]
    assert {item["quantity"] for item in growths(pl.DataFrame(rows)) if not item["holds"]} == expected
