"""Folders of runs and campaigns, and what was measured elsewhere: link traces, radio logs, logs of real robots."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.campaigns.repetition import RepeatedRun
from swarmwire.deploy.runs.scenario_parts import read_link_traces
from swarmwire.metrics.pictures.report.run_data import read_run
from swarmwire.metrics.real.radio_fit import logs as radio_logs
from swarmwire.metrics.real.real_log.real_logs import in_step, read_real_logs
from swarmwire.metrics.real.real_log.truths import real_run
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.run_folder.layout import RECORDING, SCENARIO
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.deploy.runs import LOSSY
from tests.support.metrics.campaigns import write_campaign
from tests.support.metrics.real_logs import as_logs, watched
from tests.tools.fuzz.target import FolderTarget, check_refusal

TABLES: tuple[Callable[[RunFolder], Any], ...] = (
    *(RunFolder.ticks, RunFolder.robots, RunFolder.metrics, RunFolder.packets),
    *(RunFolder.events, RunFolder.radio_robots, RunFolder.radio_distances),
)
SHORT_RUN = ("duration_s=2", "robots.flock.count=4", 'metrics=["order", "pdr", "collisions"]')
RADIO_TABLES = {
    "strengths.csv": """t_s,tx,rx,seq,rssi_dbm,distance_m
0.0,a,b,0,-60.5,1.0
0.1,a,b,1,,1.5
0.2,a,b,3,-70,2.5
0.1,b,a,0,-61,1.5
0.3,b,a,2,-72.25,3.0
""",
    "places.csv": """t_s,tx,rx,seq,rssi_dbm,tx_x_m,tx_y_m,rx_x_m,rx_y_m
0.0,a,b,0,-60.5,0,0,1,0
0.1,a,b,1,,0,0,1,1
0.2,a,b,2,-70,0,0,2,1
""",
    "network.csv": """t_s,tx,rx,seq,latency_s,distance_m
0.0,a,b,0,0.01,1.0
0.1,a,b,1,0.02,
0.3,a,b,3,0.01,2.5
0.1,b,a,0,0.015,1.5
0.3,b,a,2,,3.0
""",
}


class RunFolders(FolderTarget):
    """A short run with a live event: its tables are read and verified; deep cases are reported and repeated."""

    name = "run-folder"
    quick = 6
    soak = 200
    limit_s = 20.0

    def make(self, folder: Path) -> None:
        simulation = Simulation(LOSSY, overrides=SHORT_RUN, out=folder, record=Recording(packets=1.0, rrd=False))
        with simulation:
            for tick in range(simulation.plan.ticks):
                if tick == 5:
                    simulation.apply_event({"do": "kill", "robots": {"count": 1}, "for_s": 0.5})
                simulation.step()
        assert not (folder / RECORDING).exists()

    def is_read(self, path: Path) -> bool:
        return path.name != SCENARIO and super().is_read(path)  # the scenario's copies have targets of their own

    def read(self, folder: Path, *, deep: bool) -> str | None:
        run, refused = RunFolder(folder), list[BadInput]()
        for read in TABLES:
            try:
                read(run)
            except BadInput as error:
                check_refusal(error, str(folder))
                refused.append(error)
        for finding in verify(folder):
            repr(finding)
        if deep:
            read_run(folder)
            RepeatedRun(folder)
        if refused:
            raise refused[0]
        return None


class CampaignFolders(FolderTarget):
    """A campaign over two parameters: every sample of every response."""

    name = "campaign-folder"
    soak = 1000

    def make(self, folder: Path) -> None:
        write_campaign(folder)

    def read(self, folder: Path, *, deep: bool) -> str | None:
        campaign = CampaignFolder(folder)
        for response in campaign.responses:
            for point in range(len(campaign.points)):
                campaign.sample(response.column, point)
        return None if campaign.finished else "unfinished"


class Traces(FolderTarget):
    """Measured links that a scenario replays."""

    name = "traces"

    def make(self, folder: Path) -> None:
        folder.mkdir()
        lines = Path("scenarios/replayed-links.csv").read_text().splitlines()
        (folder / "links.csv").write_text("\n".join(lines[:200]) + "\n")
        self.robots = sorted({name for line in lines[1:] for name in line.split(",")[1:3]})

    def read(self, folder: Path, *, deep: bool) -> None:
        read_link_traces(folder / "links.csv", self.robots)


class RadioLogs(FolderTarget):
    """Tables of packets, with signal strengths or latencies."""

    name = "radio-logs"
    soak = 2000

    def make(self, folder: Path) -> None:
        folder.mkdir()
        for name, text in RADIO_TABLES.items():
            (folder / name).write_text(text)

    def read(self, folder: Path, *, deep: bool) -> None:
        for path in sorted(folder.iterdir()):
            (radio_logs.network_log_of_table if radio_logs.is_network_table(path) else radio_logs.read_log)(path)


class RobotLogs(FolderTarget):
    """Logs of three emulated robots; deep cases become a run."""

    name = "robot-logs"
    quick = 10
    soak = 500
    limit_s = 20.0
    inner = ("robots", "body", "params")
    deep = 10

    def make(self, folder: Path) -> None:
        as_logs(watched("duration_s=2", "robots.flock.count=3"), folder)

    def read(self, folder: Path, *, deep: bool) -> None:
        logs = read_real_logs(folder)
        if deep:
            real_run(in_step(logs))
            radio_logs.network_log_of_robots(logs)
