"""Films made by hand, and run folders that hold them."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.truth import Group, Light, Obstacle, Static
from swarmwire.metrics.drawing.film import Film
from swarmwire.metrics.run_folder.layout import MetricInfo

OBSTACLES = (
    Obstacle("cylinder", 2.0, 2.0, radius_m=0.4),
    Obstacle("box", -2.0, 2.0, 0.5, size_m=(0.8, 0.6)),
    Obstacle("polygon", 0.0, 2.0, points_m=((-0.4, -0.3), (0.4, -0.3), (0.0, 0.5))),
)
LIGHT = Light(2.5, -2.0, 4.0)


def two_groups(arenas: int = 1) -> Static:
    """Two e-pucks and a foot-bot in 8 x 6 m, with an obstacle of each shape and a light."""
    return Static(
        name="hand-made",
        seeds=tuple(range(1, arenas + 1)),
        rate_hz=10,
        arena_size_m=(8.0, 6.0),
        boundary="walls",
        obstacles=(OBSTACLES,) * arenas,
        groups=(Group("small", load_body("epuck"), 0, 2), Group("large", load_body("footbot"), 2, 3)),
        robot_names=("small-0", "small-1", "large-0"),
        range_m=2.0,
        lights=((LIGHT,),) * arenas,
    )


def film(ticks: int = 31, **given: Any) -> Film:
    """All move along +x by 5 cm a tick: from (-3, -1) and (-1.5, -1), which are in range, and from (0, -2.5), which is
    in nobody's."""
    pose = np.zeros((ticks, 3, 3), np.float32)
    pose[:, :, :2] = [(-3.0, -1.0), (-1.5, -1.0), (1.0, -2.5)]
    pose[:, :, 0] += 0.05 * np.arange(ticks)[:, None]
    fields: dict[str, Any] = {
        "static": two_groups(),
        "arena": 0,
        "time_s": np.arange(ticks) / 10,
        "pose": pose,
        "alive": np.ones((ticks, 3), np.bool_),
        "metrics": {"order": np.linspace(0.0, 1.0, ticks), "min_gap": np.full(ticks, np.nan)},
    }
    return Film(**{**fields, **given})


def ticks_frame(of: Film, states: Any = None, arena: int = 0) -> pl.DataFrame:
    """A film as the rows of a run folder."""
    count, robots = of.alive.shape
    columns = {"arena": pl.Series(np.full(count, arena, np.int32)), "tick": pl.Series(np.arange(count))}
    columns["time_s"] = pl.Series(of.time_s)
    for place, name in enumerate(("x_m", "y_m", "heading_rad")):
        columns[name] = pl.Series(list(of.pose[:, :, place]), dtype=pl.Array(pl.Float32, robots))
    columns["alive"] = pl.Series(of.alive.tolist(), dtype=pl.Array(pl.Boolean, robots))
    noted = [[""] * robots] * count if states is None else states
    columns["state"] = pl.Series(noted, dtype=pl.Array(pl.String, robots))
    for name, value in of.metrics.items():
        columns[name] = pl.Series(value).fill_nan(None)
    return pl.DataFrame(columns)


class Folder:
    """A run folder as far as films need it: Parquet, in parts while a run goes on."""

    def __init__(self, path: Path, static: Static | None = None) -> None:
        self.path, self.static = path, static or two_groups()
        self.measured: dict[str, MetricInfo] = {}

    def ticks(self, arena: int | None = None) -> pl.DataFrame:
        whole = self.path / "ticks.parquet"
        frame = pl.read_parquet(whole if whole.exists() else self.path / "ticks" / "part-*.parquet")
        return frame if arena is None else frame.filter(pl.col("arena") == arena)
