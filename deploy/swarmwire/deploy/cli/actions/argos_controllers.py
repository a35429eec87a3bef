"""Controllers of an ARGoS experiment: their sensors as `needs`, their parameters, and the skeleton of an agent each."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from keyword import iskeyword
from math import isfinite
from xml.etree.ElementTree import Element

from swarmwire.agent import Agent

IMPORTED = ("Agent", "Robot", "Message", "Data")  # other names of the agents' file
SENSORS = {  # ARGoS's name: the sensors that an agent needs
    "proximity": ("proximity",),
    "footbot_proximity": ("proximity",),
    "epuck_proximity": ("proximity",),
    "eyebot_proximity": ("proximity",),
    "light": ("light",),
    "footbot_light": ("light",),
    "eyebot_light": ("light",),
    "kilobot_light": ("light",),
    "ground": ("ground",),
    "footbot_motor_ground": ("ground",),
    "footbot_base_ground": ("ground",),
    "pipuck_ground": ("ground",),
    "differential_steering": ("odometry",),
    "pipuck_differential_drive": ("odometry",),
    "positioning": ("positioning", "compass"),
    "colored_blob_omnidirectional_camera": ("camera",),
    "footbot_distance_scanner": ("scan",),
    "pipuck_imu": ("imu",),
    "battery": ("battery",),
    "range_and_bearing": ("radio.range", "radio.bearing"),
    "kilobot_communication": ("radio.range",),
}
ACTUATORS = {  # ARGoS's name: the call of an agent
    "differential_steering": "robot.wheels(left_mps=0.0, right_mps=0.0)",
    "pipuck_differential_drive": "robot.wheels(left_mps=0.0, right_mps=0.0)",
    "quadrotor_position": "robot.drive(linear_mps=0.0, angular_radps=0.0, lateral_mps=0.0)",
    "quadrotor_speed": "robot.drive(linear_mps=0.0, angular_radps=0.0, lateral_mps=0.0)",
    "leds": "robot.led(red=0.0, green=0.0, blue=0.0)",
    "kilobot_led": "robot.led(red=0.0, green=0.0, blue=0.0)",
    "range_and_bearing": "robot.radio.send(Data(value=0))",
    "kilobot_communication": "robot.radio.send(Data(value=0))",
}
RADIOS = ("range_and_bearing", "kilobot_communication")
NOISY = {"proximity", "light", "ground"}  # their `noise` is ARGoS's noise_level
READINGS = {
    "proximity": "robot.proximity.value, 0 to 1 for each sensor",
    "light": "robot.light.value, 0 to 1 for each sensor",
    "ground": "robot.ground.shade, 0 black to 1 white",
    "odometry": "robot.odometry.left_m and right_m since the start",
    "positioning": "robot.positioning.x_m and y_m; robot.compass.heading_rad",
    "camera": "robot.camera, the lit LEDs in view",
    "scan": "robot.scan.range_m",
    "imu": "robot.imu",
    "battery": "robot.battery.charge, 0 to 1",
    "radio.range": "robot.radio.received(Data)",
}
IGNORED = {"implementation", "medium", "show_rays", "id", "library"}  # attributes without a meaning here

Note = Callable[[str, str], None]  # notes an element that is not taken over, and why


@dataclass
class ArgosController:
    """A controller of the experiment: the agent's class, needs, parameters and calls."""

    element: Element
    class_name: str
    needs: dict[str, str] = field(default_factory=dict[str, str])  # sensor: ARGoS's name
    calls: dict[str, str] = field(default_factory=dict[str, str])  # call: ARGoS's name
    params: dict[str, float | bool | str] = field(default_factory=dict[str, "float | bool | str"])
    noise: dict[str, float] = field(default_factory=dict[str, float])  # sensor: half width of its uniform noise

    @property
    def has_radio(self) -> bool:
        """True if it sends or receives."""
        return any(
            self.element.find(f"{part}/{name}") is not None for part in ("actuators", "sensors") for name in RADIOS
        )


def read_controllers(root: Element, note: Note) -> dict[str, ArgosController]:
    """Return the controllers of an experiment by id."""
    controllers: dict[str, ArgosController] = {}
    for element in root.iterfind("controllers/*"):
        words = re.findall(r"[A-Za-z0-9]+", element.tag.removesuffix("_controller"))
        name = "".join(word[:1].upper() + word[1:] for word in words)
        if not name.isidentifier() or iskeyword(name):
            name = f"Controller{name}"
        while name in IMPORTED or name in {other.class_name for other in controllers.values()}:
            name += "Again"
        controller = ArgosController(element, name)
        for sensor in element.iterfind("sensors/*"):
            _add_sensor(controller, sensor, note)
        for actuator in element.iterfind("actuators/*"):
            if actuator.tag in ACTUATORS:
                controller.calls.setdefault(ACTUATORS[actuator.tag], actuator.tag)
            else:
                note(f"<{actuator.tag}> of <{element.tag}>", "no robot has this actuator; a custom actuator could")
            _note_attributes(actuator, set(), note)
        params = element.find("params")
        if params is not None:
            controller.params.update(_params(params, ""))
        controllers[element.get("id", element.tag)] = controller
    return controllers


def _add_sensor(controller: ArgosController, sensor: Element, note: Note) -> None:
    if sensor.tag not in SENSORS:
        note(f"<{sensor.tag}> of <{controller.element.tag}>", "no robot has this sensor; a custom sensor could")
        return
    needs = SENSORS[sensor.tag]
    controller.needs.update(dict.fromkeys(needs, sensor.tag))
    handled = {"noise_std_dev", "packet_drop_prob"} if sensor.tag in RADIOS else set[str]()
    if needs[0] in NOISY:
        handled.add("noise_level")
        if "noise_level" in sensor.attrib:
            controller.noise[needs[0]] = float(sensor.attrib["noise_level"])
    _note_attributes(sensor, handled, note)


def _note_attributes(element: Element, handled: set[str], note: Note) -> None:
    for name in sorted(element.attrib.keys() - handled - IGNORED):
        note(f"{name} of <{element.tag}>", "set the sensor or drive in body_overrides of the group")


def _params(element: Element, prefix: str) -> Iterator[tuple[str, float | bool | str]]:
    """Return the attributes of <params> and of the elements in it as parameters of an agent."""
    for key, text in element.items():
        name = re.sub(r"\W", "_", prefix + key)
        if name[0].isdigit() or iskeyword(name) or hasattr(Agent, name):
            name = f"param_{name}"
        yield name, _value(text)
    for child in element:
        yield from _params(child, f"{prefix}{child.tag}_")


def _value(text: str) -> float | bool | str:
    if text in ("true", "false"):
        return text == "true"
    try:
        number = float(text)
    except ValueError:
        return text
    return number if isfinite(number) else text


def agents_text(source: str, controllers: list[ArgosController]) -> str:
    """Return a Python file with a class for each controller, whose `step` reads nothing yet and stands still."""
    has_radio = any(controller.has_radio for controller in controllers)
    imports = "Agent, Message, Robot, u1" if has_radio else "Agent, Robot"
    lines = [
        f'"""The controllers of {source}: write each rule into `step`, which was ControlStep()."""',
        "",
        f"from swarmwire.agent import {imports}",
    ]
    if has_radio:
        lines += [
            "",
            "",
            "class Data(Message):",
            '    """The data of a packet: name its fields."""',
        ]
        lines += ["", "    value: u1"]
    for controller in controllers:
        tag = controller.element.tag
        names = [f'"{name}"' for name in controller.needs]
        needs = ", ".join(names) + ("," if len(names) == 1 else "")
        lines += ["", "", f"class {controller.class_name}(Agent):"]
        lines += [f'    """<{tag}>; its parameters have the units that they had there, such as cm/s."""', ""]
        lines += [f"    needs = ({needs})"]
        lines += [f"    {name}: {type(value).__name__}" for name, value in controller.params.items()]
        lines += ["", "    def step(self, robot: Robot) -> None:"]
        lines += [
            f"        # <{argos}>: {READINGS[name]}" for name, argos in controller.needs.items() if name in READINGS
        ]
        lines += [f"        {call}  # <{argos}>" for call, argos in controller.calls.items()]
        if not controller.calls:
            lines.append('        robot.note("no actuator")')
    return "\n".join(lines) + "\n"
