"""Folders of runs: looked into table by table, verified, and run again."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.repetition import RepeatedRun
from swarmwire.metrics.record.names import RECORDING, SCENARIO
from swarmwire.metrics.report.run_data import read_run
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.verify import verify
from tests.support.deploy.commands import LOSSY
from tests.tools.fuzz.folder_target import FolderTarget
from tests.tools.fuzz.target import check_line

TABLES: tuple[Callable[[RunFolder], Any], ...] = (
    *(RunFolder.ticks, RunFolder.robots, RunFolder.metrics, RunFolder.packets),
    *(RunFolder.events, RunFolder.radio_robots, RunFolder.radio_distances),
)
SMALL = ("duration_s=2", "robots.flock.count=4", 'metrics=["order", "pdr", "collisions"]')


class RunFolders(FolderTarget):
    """What a run left: its tables, and what is needed to run it again."""

    name = "run-folder"
    quick = 40
    limit_s = 20.0

    def make(self, folder: Path) -> None:
        """A short run to which somebody did something."""
        simulation = Simulation(LOSSY, overrides=SMALL, out=folder, record=Recording(packets=1.0, rrd=False))
        with simulation:
            for tick in range(simulation.ticks):
                if tick == 5:
                    simulation.intervene({"do": "kill", "robots": {"count": 1}, "for_s": 0.5})
                simulation.step()
        assert not (folder / RECORDING).exists()

    def is_read(self, path: Path) -> bool:
        """All but copies of files, which are the scenario's affair."""
        return path.name != SCENARIO and super().is_read(path)

    def read(self, folder: Path, *, deep: bool) -> str | None:
        """Its tables and findings; some are drawn, and made ready to be run again."""
        of, refused = RunFolder(folder), list[BadInput]()
        for read in TABLES:
            try:
                read(of)
            except BadInput as error:
                check_line(error, str(folder))
                refused.append(error)
        for finding in verify(folder):
            repr(finding)
        if deep:
            read_run(folder)
            RepeatedRun(folder)
        if refused:
            raise refused[0]
        return None
