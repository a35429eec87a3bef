"""The keys of a scenario and of a body's sheet, with what each expects, its unit and its default."""

from collections.abc import Iterable

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.custom import CustomActuatorSpec
from swarmwire.comms.bodies.drives import DRIVES, Leds
from swarmwire.comms.sensors import SENSOR_SPECS
from swarmwire.deploy.catalogue.scenario import all_keys
from swarmwire.deploy.catalogue.schema import Parameter, parameters_of_dataclass


def text() -> str:
    """A key a line, by its path; a body's sheet after the scenario."""
    tables = {f"drive, kind = {name}": kind for name, kind in DRIVES.items()}
    tables |= {"leds": Leds, "actuators.*": CustomActuatorSpec}
    tables |= {f"sensors.{name}": kind for name, kind in SENSOR_SPECS.items()}
    of_body = (of for of in parameters_of_dataclass(Body) if of.name.partition(".")[0] not in ("drive", "leds"))
    parts = ["# a scenario", *_lines(all_keys()), "# a body's sheet", *_lines(of_body)]
    for title, kind in tables.items():
        parts += [f"# a body's sheet: {title}", *_lines(parameters_of_dataclass(kind))]
    return "\n".join(parts) + "\n"


def _lines(keys: Iterable[Parameter]) -> list[str]:
    return [f"{key.name}: {key.expected}{f' in {key.unit}' if key.unit else ''}; {_given(key)}" for key in keys]


def _given(key: Parameter) -> str:
    return "required" if key.required else f"default {key.value!r}"
