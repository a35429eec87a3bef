"""A run in one terminal, and in another what it printed: the agent drives its robot, and is received there."""

import json
import signal
import subprocess
import sys
from pathlib import Path

from tests.support.deploy.commands import ROOT

SCENARIO = ROOT / "scenarios" / "robots" / "flocking-epuck2.toml"
PROGRAMS = Path(sys.executable).parent


def test_the_printed_command_drives_the_robot(tmp_path) -> None:
    command = [sys.executable, "-m", "swarmwire.deploy", "run", SCENARIO, "--gateway", "epuck2", "--realtime=2"]
    more = ["--set", "robots.flock.count=2", "--out", tmp_path / "run", "--no-rrd"]
    with subprocess.Popen([*command, *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as run:
        assert run.stdout is not None
        try:
            line = next(line for line in run.stdout if line.startswith("flock-1"))
            program, *arguments = line.split()[3:]
            assert program == "swarmwire-agent"
            agent = subprocess.run(
                [PROGRAMS / program, *arguments, "--duration-s", "4"],
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
        finally:
            run.send_signal(signal.SIGINT)
            run.stdout.read()
    assert agent.returncode == 0, agent.stderr
    assert "flock-1: ended (duration)" in agent.stdout
    assert run.returncode == 130
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["radio"]["sent"] > 20, agent.stdout
    assert summary["inputs"]["ticks"] == summary["ticks"]
