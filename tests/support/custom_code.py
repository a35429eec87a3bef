"""Code of users: sensors, actuators and other parts of a world, and installed packages that bring metrics."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.world.custom import CustomActuator, CustomSensor, Field, Noise, parameter

NOTHING = 1
CODE = '''
from dataclasses import dataclass

from swarmwire.comms.base.config import parameter
from swarmwire.metrics.measures.metric import Metric


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


@dataclass
class Paint(CustomSensor):
    """How far the robot's painter has got, and its tick in three cells."""

    scale: float = parameter(1.0, help="by which what is told is multiplied", above=0)
    noise: float = parameter(0.0, help="of the amount", at_least=0)
    cells: int = parameter(3, help="how many", at_least=1)

    @property
    def fields(self) -> Any:
        return Field("amount", noise=Noise("normal", self.noise)), Field("ticks", self.cells, low=0.0, blank=-1.0)

    def start(self) -> None:
        self.scene.shared.setdefault("painted", np.zeros(self.scene.touched.shape))
        self.followed = 0

    def follow(self, tick: int) -> None:
        self.followed += 1

    def truth(self, tick: int) -> Any:
        amount = self.scale * self.scene.shared["painted"][:, self.group.start : self.group.stop]
        return amount, np.full((*amount.shape, self.cells), tick + self.followed)


@dataclass
class Painter(CustomActuator):
    """Adds up what it is set to; set to a negative first number it stops the robot."""

    gain: float = parameter(1.0, help="of what is added", above=0)

    @property
    def width(self) -> Any:
        return 2

    def act(self, tick: int, rows: Any, values: Any) -> None:
        arena, robot = self.at(rows)
        painted = self.scene.shared.setdefault("painted", np.zeros(self.scene.touched.shape))
        painted[arena, robot] += self.gain * values[:, 1]
        stopped = values[:, 0] < 0.0
        self.scene.target[arena[stopped], robot[stopped]] = 0.0


@dataclass(frozen=True)
class Frozen(CustomSensor):
    """Cannot be told its scene."""

    @property
    def fields(self) -> Any:
        return (Field("x"),)

    def truth(self, tick: int) -> Any:
        raise AssertionError("nobody asks")


@dataclass
class Alone(CustomSensor):
    """A single field needs no tuple."""

    @property
    def fields(self) -> Any:
        return (Field("x"),)

    def truth(self, tick: int) -> Any:
        return self.pose[:, :, 0]


@dataclass
class Raises(Alone):
    def truth(self, tick: int) -> Any:
        return 1 / tick


@dataclass
class WrongShape(Alone):
    def truth(self, tick: int) -> Any:
        return np.zeros(3)


@dataclass
class TellsNothing(Alone):
    def truth(self, tick: int) -> Any:
        return None


@dataclass
class TellsANumber(Alone):
    def truth(self, tick: int) -> Any:
        return 3


@dataclass
class TellsWords(Alone):
    def truth(self, tick: int) -> Any:
        return ([["near", "far"]],)


@dataclass
class TellsNan(Alone):
    def truth(self, tick: int) -> Any:
        return np.full((1, 2), np.nan)


@dataclass
class NoTruth(CustomSensor):
    @property
    def fields(self) -> Any:
        return (Field("x"),)


@dataclass
class NoFields(Alone):
    @property
    def fields(self) -> Any:
        return "x"


@dataclass
class Twice(Alone):
    @property
    def fields(self) -> Any:
        return (Field("x"), Field("x"))


@dataclass
class WideField(Alone):
    @property
    def fields(self) -> Any:
        return (Field("x", 10_001),)


@dataclass
class Refuses(Alone):
    def __post_init__(self) -> None:
        raise ValueError("no")


class Plain(Alone):
    """No dataclass of its own, but below one."""


@dataclass
class NoWidth(Painter):
    @property
    def width(self) -> Any:
        return 0


@dataclass
class TooWide(Painter):
    @property
    def width(self) -> Any:
        return 10_001


@dataclass
class Breaks(CustomActuator):
    def act(self, tick: int, rows: Any, values: Any) -> None:
        raise RuntimeError("jammed")


@dataclass
class Bursts(CustomActuator):
    """Writes what is not finite to where robot 1 reads what it should do, or to its charge."""

    where: str = parameter(help="target or charge")
    value: str = parameter(help="what it writes, as a text: no sheet holds what is not finite")

    def act(self, tick: int, rows: Any, values: Any) -> None:
        if tick == 1:
            getattr(self.scene, self.where)[0, 1] = float(self.value)


@dataclass
class Flashes(CustomActuator):
    """Switches the first LED of whoever sets it."""

    def act(self, tick: int, rows: Any, values: Any) -> None:
        arena, robot = self.at(rows)
        self.scene.leds[arena, robot, 0] = values[:, 0].astype(np.int64)


@dataclass
class Keyed(Alone):
    """A key that is named as one of told sheets, and one that may be anything."""

    params: int = parameter(1, help="a number")
    any: Any = field(default=None)


@dataclass
class Wide(Breaks):
    """How many numbers it takes is a key."""

    # pyright minds a key of the sheet in the place of a property: it may stand there, which is what is tested.
    width: int = parameter(1, help="how many numbers it takes")  # pyright: ignore[reportIncompatibleMethodOverride]
    params: int = parameter(1, help="a number")
    any: Any = field(default=None)


def install(
    site: Path, name: str, points: Mapping[str, str], code: str = CODE, group: str = "swarmwire.metrics"
) -> None:
    """A package of this name in the folder `site`: a module with `code`, and entry points {name: class within it}."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{point} = {name}:{target}" for point, target in points.items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
    (site / f"{name}.py").write_text(code)
