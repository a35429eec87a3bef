"""A run as an MCAP file, for Foxglove, rviz and `ros2 bag`."""

from pathlib import Path

import numpy as np
from rich.progress import track

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import MCAP
from swarmwire.deploy.cli.actions.export_metrics_table import chosen_ticks
from swarmwire.deploy.cli.exporters import BAG, ExportOptions
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.metrics.records.bag.run_bag import RunBag
from swarmwire.metrics.records.run_folder.layout import MOVABLE, RADIO, VALUE
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.ticks import robot_columns


def write_bag(run: Path, to: Path, options: ExportOptions) -> str:
    """Write an arena from `from_s` to `until_s`."""
    check_output_path(to, BAG.suffixes)
    MCAP.need(str(to))
    folder, arena = RunFolder(run), options.arena or 0
    if not 0 <= arena < folder.static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {folder.static.arenas - 1}, got {arena}")
    unused = [*robot_columns(folder.static), VALUE, *MOVABLE, *RADIO, *folder.measured]
    times = folder.table("ticks", arena, unused).sort("tick")
    if times.is_empty():
        raise BadInput(str(run), "", "holds no tick yet")
    ticks = times["tick"].to_numpy()[np.flatnonzero(chosen_ticks(times["time_s"].to_numpy(), options))]
    console = TerminalConsole()
    with output_file(to) as part, part.open("wb") as file:
        bag = RunBag(file, folder, arena)
        written = bag.write(range(int(ticks[0]), int(ticks[-1]) + 1))
        for _ in track(
            written, "writing", len(ticks), console=console, transient=True, disable=not console.is_terminal
        ):
            pass
    return f"{bag.bag.count} messages"
