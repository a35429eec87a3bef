"""Records of today's formats, small ones, to be kept beside those of earlier versions.

    python -m tests.release.make_records FOLDER

Done when a format has been raised, and before a release; whoever makes later versions reads what this one wrote.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from swarmwire.deploy import Recording, Simulation
from tests.unit.metrics.real_log.test_written_on_robots import by_robots

SCENARIO = """format = 1
name = "tiny"
seed = 5
duration_s = 1.0

[arena]
size_m = [3.0, 3.0]

[robots.flock]
body = "epuck"
count = 3
agent = "swarmwire.agent.behaviours:Flocking"

[radio]
range_m = 2.0
loss = 0.2
latency_s = 0.05
gives = { range = {}, bearing = {} }

[[events]]
at_s = 0.5
do = "kill"
robots = { group = "flock", count = 1 }
"""
SWEEP = ("sweep", "tiny.toml", "--vary", "radio.loss=0.0,0.5", "--seeds", "1:3", "--workers", "1", "--out", "campaign")
OF_TUNE = ("--trials", "3", "--seeds", "1:3", "--check-seeds", "2", "--workers", "1", "--out", "tuning")
TUNE = (
    "tune",
    "tiny.toml",
    "--search",
    "robots.flock.params.separation_m=0.2:0.6",
    "--goal",
    "max order.q50",
    *OF_TUNE,
)

ROWS = 30  # of each table of a robot's log
CERTS = (("certs", "init", "certificates"), ("certs", "issue", "certificates", "robot-1"))


def make(folder: Path) -> None:
    """A run with what came from outside, robots' logs, a campaign, a tuning, certificates."""
    folder.mkdir(parents=True)
    by_robots(folder / "robots")
    shorten(folder / "robots")
    (folder / "tiny.toml").write_text(SCENARIO, encoding="utf-8")
    record_run(folder)
    for arguments in (SWEEP, TUNE, *CERTS):
        subprocess.run([sys.executable, "-m", "swarmwire.deploy", *arguments], cwd=folder, check=True)


def shorten(logs: Path) -> None:
    """Leave two robots' logs, as they would be had the power gone early."""
    for log in sorted(logs.iterdir())[2:]:
        shutil.rmtree(log)
    for table in logs.glob("*/*.csv"):
        table.write_text("".join(table.read_text().splitlines(keepends=True)[:ROWS]))


def record_run(folder: Path) -> None:
    """In real time, so that all that its runner answered is recorded, and with an event that somebody gave."""
    os.chdir(folder)  # so that nobody's paths stand in the record
    recording = Recording(packets=1.0, rrd=False)
    with Simulation("tiny.toml", runners=1, realtime=20.0, record=recording, out="run") as simulation:
        simulation.run(3)
        simulation.intervene({"do": "blackout", "robots": {"group": "flock", "count": 1}, "for_s": 0.3})
        simulation.run()


if __name__ == "__main__":
    make(Path(sys.argv[1]).absolute())
