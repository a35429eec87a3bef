"""What was measured elsewhere: traces of links, logs of radios, and the logs of real robots."""

import shutil
from pathlib import Path

from swarmwire.deploy.radio.link_trace_file import read_link_traces
from swarmwire.metrics.radio_fit.network_log import is_network_table, network_log_of_robots, network_log_of_table
from swarmwire.metrics.radio_fit.read_log import read_log
from swarmwire.metrics.real_log.clock_offsets import in_step
from swarmwire.metrics.real_log.real_logs import read_real_logs
from swarmwire.metrics.real_log.truths import real_run
from tests.support.metrics.real_log.as_logs import as_logs
from tests.support.metrics.real_log.emulated import watched
from tests.tools.fuzz.folder_target import FolderTarget

STRENGTHS = """t_s,tx,rx,seq,rssi_dbm,distance_m
0.0,a,b,0,-60.5,1.0
0.1,a,b,1,,1.5
0.2,a,b,3,-70,2.5
0.1,b,a,0,-61,1.5
0.3,b,a,2,-72.25,3.0
"""
PLACES = """t_s,tx,rx,seq,rssi_dbm,tx_x_m,tx_y_m,rx_x_m,rx_y_m
0.0,a,b,0,-60.5,0,0,1,0
0.1,a,b,1,,0,0,1,1
0.2,a,b,2,-70,0,0,2,1
"""
NETWORK = """t_s,tx,rx,seq,latency_s,distance_m
0.0,a,b,0,0.01,1.0
0.1,a,b,1,0.02,
0.3,a,b,3,0.01,2.5
0.1,b,a,0,0.015,1.5
0.3,b,a,2,,3.0
"""


class Traces(FolderTarget):
    """Measured links that a scenario replays."""

    name = "traces"

    def make(self, folder: Path) -> None:
        """The shipped one."""
        folder.mkdir()
        shutil.copy("scenarios/replayed-links.csv", folder / "links.csv")
        lines = (folder / "links.csv").read_text().splitlines()
        (folder / "links.csv").write_text("\n".join(lines[:200]) + "\n")
        names = {name for line in lines[1:] for name in line.split(",")[1:3]}
        self.robots = sorted(names)

    def read(self, folder: Path, *, deep: bool) -> None:
        """As the air has them."""
        read_link_traces(folder / "links.csv", self.robots)


class RadioLogs(FolderTarget):
    """Tables of packets, with strengths or without."""

    name = "radio-logs"

    def make(self, folder: Path) -> None:
        """A few rows of each kind."""
        folder.mkdir()
        for name, text in (("strengths", STRENGTHS), ("places", PLACES), ("network", NETWORK)):
            (folder / f"{name}.csv").write_text(text)

    def read(self, folder: Path, *, deep: bool) -> None:
        """Each as what it is."""
        for path in sorted(folder.iterdir()):
            if is_network_table(path):
                network_log_of_table(path)
            else:
                read_log(path)


class RobotLogs(FolderTarget):
    """Logs of real robots."""

    name = "robot-logs"
    quick = 100
    limit_s = 20.0
    inner = ("robots", "body", "params")
    deep = 0.1

    def make(self, folder: Path) -> None:
        """Those of an emulated flock of three in two seconds."""
        as_logs(watched("duration_s=2", "robots.flock.count=3"), folder)

    def read(self, folder: Path, *, deep: bool) -> str | None:
        """As logs; some as the run that they tell of."""
        logs = read_real_logs(folder)
        if not deep:
            return None
        real_run(in_step(logs))
        network_log_of_robots(logs)
        return "made into a run"
