"""Installed packages made by hand, which bring metrics as entry points."""

from collections.abc import Mapping
from pathlib import Path

CODE = '''
from dataclasses import dataclass

from swarmwire.comms.config import parameter
from swarmwire.metrics.metric import Metric


@dataclass(frozen=True)
class East(Metric):
    """Mean x of the robots alive."""

    from_m: float = parameter(0.0, help="where x is counted from", unit="m", at_least=-9.0, at_most=9.0)

    name = "east"
    help = "mean x of the robots alive, in m"
    unit = "m"
    bounds = (-1e9, None)

    def begin(self, static):
        return lambda moment: (moment.sum_alive(moment.pose[:, :, 0]) / moment.per_robot_alive) - self.from_m
'''


def install(site: Path, name: str, points: Mapping[str, str], code: str = CODE) -> None:
    """A package of this name in the folder `site`: a module with `code`, and entry points {name: class within it}."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{point} = {name}:{of}" for point, of in points.items()]
    (info / "entry_points.txt").write_text("\n".join(["[swarmwire.metrics]", *lines, ""]))
    (site / f"{name}.py").write_text(code)
