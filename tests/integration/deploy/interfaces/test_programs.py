"""Programs on robots: their surroundings, their end, and `swarmwire exec`."""

import json
import os
import re
import signal

import psutil

from swarmwire.deploy import repeat, run
from tests.support.clocks import until
from tests.support.deploy.interfaces import DISK, STILL, line, needs_interfaces, needs_program, running, with_program
from tests.support.deploy.runs import swarmwire
from tests.support.refusals import refused_input

pytestmark = needs_interfaces


def test_program_knows_its_robot_and_its_output_and_end_are_kept(tmp_path):
    script = 'env | grep ^ROBOT; hostname; cat /sys/class/net/radio0/address; pwd; touch "$ROBOT_SCRATCH/mine"; exit 7'
    scenario = with_program(line(2), "sh", "-c", script).replace("3600", "2") + DISK
    with running(tmp_path, scenario, "--packets", "all") as world:
        assert world.process.wait(60) == 0
    lines = world.output("line-1").splitlines()
    names = {"ROBOT": "line-1", "ROBOT_INDEX": "1", "ROBOT_INTERFACE": "radio0", "ROBOT_IPV4": "10.77.0.2"}
    names |= {"ROBOT_IPV6": "fd53:57::2", "ROBOT_MAC": "02:53:57:00:00:02"}
    names |= {"ROBOT_SCRATCH": f"{world.folder}/programs/line-1"}
    assert dict(line.split("=") for line in lines[:-3]) == names
    assert lines[-3:] == ["line-1", "02:53:57:00:00:02", str(tmp_path)]
    assert (world.folder / "programs/line-1/mine").exists()
    events = json.loads((world.folder / "summary.json").read_text())["events"]
    ends = sorted((event["do"], event["part"], *event["robots"]) for event in events)
    assert ends == [("program_ended", "exit code 7", robot) for robot in ("line-0", "line-1")]
    assert swarmwire("verify", world.folder).returncode == 0
    assert repeat(world.folder).same


def test_programs_that_fail_alike_are_reported_once_with_the_last_line(tmp_path):
    script = 'echo starting; echo "no map of $ROBOT"; test $ROBOT = line-2 || exit 7'
    scenario = with_program(line(3), "sh", "-c", script).replace("3600", "2") + DISK
    with running(tmp_path, scenario) as world:
        output, _ = world.process.communicate(timeout=60)
    (report,) = [text for text in output.splitlines() if text.startswith("the program of ")]
    assert re.fullmatch(r"the program of (line-[01]) ended \(exit code 7\): no map of \1", report)


def sleepers_of(pid: int) -> list[psutil.Process]:
    """The processes named sleep below a process."""
    return [process for process in psutil.Process(pid).children(recursive=True) if process.name() == "sleep"]


def test_program_dies_with_its_robot_and_starts_when_it_is_revived(tmp_path):
    script = "trap '' TERM; echo started; sleep 1000 & wait"
    kill = '\n[[events]]\ndo = "kill"\nrobots = { names = ["line-0"] }\nat_s = 0.5\nfor_s = 0.5\n'
    with running(tmp_path, with_program(line(2), "sh", "-c", script) + DISK + kill) as world:
        until(lambda: world.output("line-0").count("started") == 2)
        assert world.output("line-1").count("started") == 1
        sleepers = until(lambda: sleepers_of(world.process.pid), lambda processes: len(processes) == 2)
        os.kill(world.process.pid, signal.SIGKILL)
        until(lambda: not any(process.is_running() for process in sleepers))


@needs_program("ping")
def test_exec_runs_a_command_on_a_robot_which_knows_the_others_by_name(tmp_path):
    with running(tmp_path, line(2) + DISK) as world:
        done = swarmwire("exec", world.folder, "line-0", "--", "ping", "-c", "1", "line-1")
        assert done.returncode == 0, done.stderr
        assert re.search(r"1 received", done.stdout)
        assert swarmwire("exec", world.folder, "line-0", "--", "sh", "-c", "exit 3").returncode == 3
        assert swarmwire("exec", world.folder, "line-0", "--", "no-such").returncode == 127
        unknown = swarmwire("exec", world.folder, "line-7")
        assert (unknown.returncode, "expected one of line-" in unknown.stderr) == (2, True)
        world.end()
    over = swarmwire("exec", world.folder, "line-0", "--", "true")
    assert over.returncode == 2
    assert "expected the folder of a running simulation with network interfaces" in over.stderr


def test_program_that_is_missing_or_has_no_network_is_refused_at_the_start(tmp_path):
    (tmp_path / "still.py").write_text(STILL)
    path = tmp_path / "scenario.toml"
    path.write_text(with_program(line(1), "no-such-program") + DISK + "[radio.interface]")
    with refused_input(key="robots.line.program", match="no-such-program"):
        run(path, realtime=1, out=tmp_path / "out")
    path.write_text(with_program(line(1), "true") + DISK)
    with refused_input(key="robots.line.program", match=r"\[radio.interface\]"):
        run(path, realtime=1, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
