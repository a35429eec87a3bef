"""Draws docs/stages.svg: one sensor from the truth to its reading."""

# pyright: basic, reportUnknownMemberType=false

from pathlib import Path

import numpy as np

from docs.pictures.radio.sheet import line_color, panels, set_labels
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.sensors.sensor import Field, Noise, RangedSensorSpec
from swarmwire.metrics.pictures.drawing.canvas import FAINT, save
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Sensor

TO = Path(__file__).parents[1] / "stages.svg"
TICK_S, TICKS = 0.1, 60
NOISE, STEP = Noise("normal", 0.04), 0.1
SENSOR_SPECS = {
    "as it is": (RangedSensorSpec(), Field("value", high=1.0)),
    "noise, outliers": (RangedSensorSpec(outlier=0.08), Field("value", noise=NOISE, low=0.0, high=1.0)),
    "steps, drop-out": (RangedSensorSpec(outlier=0.08, drop_out=0.1), Field("value", 0, NOISE, STEP, 0.0, 1.0)),
    "5 Hz, 0.3 s late": (
        RangedSensorSpec(outlier=0.08, drop_out=0.1, rate_hz=5.0, delay_s=0.3),
        Field("value", 0, NOISE, STEP, 0.0, 1.0),
    ),
}


class Wave(Sensor):
    """A number that rises and falls."""

    def __init__(self, field: Field) -> None:
        self._field = field

    @property
    def fields(self) -> tuple[Field, ...]:
        """The number."""
        return (self._field,)

    def truth(self, tick: int) -> FloatArray:
        """The number in a tick."""
        return np.full((1, 1), 0.5 + 0.4 * np.sin(1.6 * tick * TICK_S))


def draw(to: Path = TO) -> None:
    """Write the figure."""
    figure, row = panels(len(SENSOR_SPECS), 2.1)
    at_s = TICK_S * np.arange(TICKS)
    truth = readings_of("as it is")
    for i, (axes, title) in enumerate(zip(row, SENSOR_SPECS, strict=True)):
        axes.plot(at_s, truth, color=FAINT, lw=1.2)
        axes.plot(at_s, readings_of(title), ".", ms=2.6, color=line_color(i))
        axes.set_ylim(-0.05, 1.05)
        set_labels(axes, title, "time in s", "reading" if i == 0 else "")
    save(figure, to)


def readings_of(name: str) -> FloatArray:
    """The reading of each tick, NaN where it is lost, (ticks,)."""
    spec, field = SENSOR_SPECS[name]
    keys = np.array([derive_key("figure of stages")], np.uint64)
    sensor = SensorPipeline("wave", Wave(field), spec, keys, Group("a", load_body("epuck"), 0, 1), TICK_S)
    return np.array([sensor.read(tick)["wave.value"][0] for tick in range(TICKS)])


if __name__ == "__main__":
    draw()
