"""What must hold of every run is found broken where it is."""

import subprocess
import sys
from dataclasses import replace

import pytest

from tests.support.deploy.commands import LOSSY
from tests.support.deploy.recorded import record_run
from tests.support.waiting import until
from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken
from tests.tools.soak.samples import Sample, Samples, read_samples
from tests.tools.soak.supervised import Supervised
from tests.tools.soak.verdict import flatness

ROBOTS = ("a", "b")
STILL = Sample(0.0, "a world", 0, 400.0, 200.0, 60, 38, 0.0, 20.0, 0)


def summary(*changes):
    told = [{"what": what, "runner": runner, "robots": robots, "tick": tick} for what, runner, robots, tick in changes]
    gone = [change["what"] for change in told]
    return {"runner_changes": told, "counts": {"runners_lost": gone.count("lost"), "runners_left": gone.count("left")}}


JOINED = ("joined", "r0", ROBOTS, -1)


def test_each_robot_has_one_owner_or_is_told_to_have_none():
    fine = summary(JOINED, ("lost", "r0", ROBOTS, 4), ("joined", "r1", ("a",), 5), ("returned", "r0", ("b",), 6))
    assert invariants.owners_are_known(fine, ROBOTS).startswith("2 robots played")


@pytest.mark.parametrize(
    "changes",
    [
        (JOINED, ("joined", "r1", ("a",), 4)),  # taken twice
        (JOINED, ("lost", "r1", ("a",), 4)),  # another's
        (JOINED, ("lost", "r0", ("a",), 4), ("lost", "r0", ("a",), 5)),  # lost twice
        (JOINED, ("lost", "r0", ("c",), 4)),  # no robot
        (("joined", "r0", ("a",), -1), ("lost", "r0", ("a",), 4)),  # begun without an agent for all
    ],
)
def test_robots_of_two_runners_or_of_none_are_found(changes):
    with pytest.raises(Broken):
        invariants.owners_are_known(summary(*changes), ROBOTS)


def test_losses_that_are_told_but_not_counted_are_found():
    of = summary(JOINED, ("lost", "r0", ROBOTS, 4))
    with pytest.raises(Broken, match="1 runners left or were lost, the counts say 0"):
        invariants.owners_are_known({**of, "counts": {}}, ROBOTS)


def test_fates_that_do_not_add_up_are_found():
    assert invariants.fates_add_up({"radio": {"intended": 3, "fates": {"heard": 2, "lost": 1}}})
    with pytest.raises(Broken, match="the fates sum to 2, of 3"):
        invariants.fates_add_up({"radio": {"intended": 3, "fates": {"heard": 2}}})


def test_a_folder_that_is_not_whole_or_another_run_is_found(tmp_path):
    folder = tmp_path / "run"
    record_run(folder, overrides=["duration_s=0.5", "robots.flock.count=3"])
    assert invariants.folder_is_whole(folder)
    assert invariants.repeats(folder)
    assert invariants.undisturbed(folder)
    changed = (folder / "scenario.toml").read_text().replace("loss = 0.3", "loss = 0.4")
    assert changed != LOSSY.read_text()
    (folder / "scenario.toml").write_text(changed)
    for check in (invariants.repeats, invariants.undisturbed):
        with pytest.raises(Broken):
            check(folder)
    (folder / "static.json").unlink()
    with pytest.raises(Broken, match=r"static\.json: missing"):
        invariants.folder_is_whole(folder)


def test_what_is_left_is_found_and_who_crashed(tmp_path):
    command = (sys.executable, "-c", "input()")
    with subprocess.Popen(command, env={"TMPDIR": str(tmp_path)}, stdin=subprocess.PIPE) as process:
        with pytest.raises(Broken, match=f"left: {process.pid} "):
            invariants.nobody_is_left(tmp_path, 0)
        process.communicate(b"\n")
    assert invariants.nobody_is_left(tmp_path, 0)
    assert invariants.nothing_is_left(tmp_path)
    (tmp_path / "sw-1").mkdir()
    with pytest.raises(Broken, match="sw-1"):
        invariants.nothing_is_left(tmp_path)
    assert invariants.nothing_is_left(tmp_path, killed=True)
    assert invariants.nobody_crashed({"r0": {"0": 3, "-9": 1}})
    with pytest.raises(Broken, match="r0 -6"):
        invariants.nobody_crashed({"r0": {"0": 3, "-6": 1}})


def test_who_ends_is_started_again(tmp_path):
    one = Supervised("one", lambda: (sys.executable, "-c", "raise SystemExit(3)"), tmp_path / "log", {}, again_s=2e-9)
    until(lambda: one.tend(0) or one.starts)
    until(lambda: one.tend(0) or one.codes)
    assert (one.codes, one.starts) == ([3], 1)
    one.tend(1)
    assert one.starts == 1
    one.tend(2)
    assert one.starts == 2
    one.end()


def grown(**by):
    """An hour in which something grows."""
    rows = [
        replace(
            STILL,
            at_s=10.0 * n,
            tick=100 * n,
            cpu_s=3.0 * n,
            **{name: getattr(STILL, name) + n * of for name, of in by.items()},
        )
        for n in range(361)
    ]
    return {one.what for one in flatness({"a world": rows}, 3600.0) if not one.holds}


def test_growth_is_found_by_what_grows():
    assert grown() == set()
    assert grown(rss_mib=0.01) == set()  # 3.6 MiB
    assert grown(rss_mib=0.1) == {"memory, MiB"}
    assert grown(descriptors=1) == {"descriptors"}
    assert grown(threads=1) == {"threads"}
    slower = [replace(STILL, at_s=10.0 * n, tick=100 * n, cpu_s=3.0 * n + n * n / 300) for n in range(361)]
    assert [one.what for one in flatness({"a world": slower}, 3600.0) if not one.holds] == [
        "processor time of a tick, ms"
    ]


def test_samples_are_read_as_they_were_taken(tmp_path):
    samples = Samples(tmp_path / "samples.csv")
    code, pipe = "print(1, flush=True); input()", subprocess.PIPE
    with subprocess.Popen((sys.executable, "-c", code), stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        process.stdout.readline()  # what it has is there
        samples.take(1.0, {"a world": process.pid, "nobody": None}, 7, 2.5, 3)
        process.communicate(b"\n")
    samples.take(2.0, {"a world": process.pid}, 8, 2.5, 3)
    [(who, [row])] = read_samples(tmp_path / "samples.csv").items()
    assert (who, row.tick, row.tick_ms, row.events) == ("a world", 7, 2.5, 3)
    assert row.rss_mib > 1.0
    assert row.threads >= 1
