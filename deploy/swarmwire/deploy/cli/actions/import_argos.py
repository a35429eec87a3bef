"""`swarmwire import`: a scenario, and the skeleton of its agents, from an ARGoS experiment."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import tomli_w

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.actions.argos_arena import (
    Draft,
    Positions,
    Table,
    add_entity,
    add_robots,
    clear_light,
    point_of,
    size_around,
    title_of,
)
from swarmwire.deploy.cli.actions.argos_controllers import RADIOS, agents_text, read_controllers
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.terminal.output import echo

LIST = re.compile(r"\[\s+((?:[^\s\[\]{}\"]+,\s+)+)\]")  # of plain values, over several lines
ENDLESS_S = 60.0  # duration of an experiment without an end
RANGES_M = {"foot-bot": 3.0, "e-puck": 0.8, "pi-puck": 0.8, "eye-bot": 3.0, "spiri": 3.0}  # rab_range, as it comes


def import_argos(experiment: Path, folder: Path) -> None:
    """Write the scenario and the agents into a folder, and print what they lack."""
    name = re.sub(r"\W", "_", experiment.stem)
    scenario_path, agents_path = folder / f"{name}.toml", folder / f"{name}.py"
    for path in (scenario_path, agents_path):
        if path.exists():
            raise BadInput(str(path), "", "expected a name that is free: something is there already")
    scenario, agents, notes = convert_argos(experiment, agents_path.name)
    header = [f"# From ARGoS's {experiment.name} by swarmwire import.", *(f"# Differs: {note}" for note in notes)]
    try:
        write_text(scenario_path, "\n".join(header) + "\n\n" + _toml(scenario))
        write_text(agents_path, agents)
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be written: {error.strerror}") from error
    echo(f"written: {scenario_path}, {agents_path}")
    for note in notes:
        echo(f"differs: {note}")
    echo(f"check it:  {command_path()} check {scenario_path}")


def _toml(scenario: Table) -> str:
    """Return a mapping as TOML, with each list of numbers in one line."""
    return LIST.sub(lambda match: f"[{' '.join(match[1].split()).removesuffix(',')}]", tomli_w.dumps(scenario))


def convert_argos(experiment: Path, agents_file: str) -> tuple[Table, str, list[str]]:
    """Return the scenario's mapping, the text of the agents' file, and a line for each element not taken over."""
    where = str(experiment)
    try:
        root = ET.parse(experiment).getroot()
    except OSError as error:
        raise BadInput(where, "", f"expected a readable file: {error.strerror}") from None
    except (ET.ParseError, LookupError) as error:  # LookupError: an encoding that Python lacks
        raise BadInput(where, "", f"expected XML: {error}") from None
    if root.tag != "argos-configuration":
        raise BadInput(where, root.tag, "expected an experiment of ARGoS, <argos-configuration>")
    draft = Draft(root, where, agents_file)
    try:
        scenario = _scenario(draft, experiment)
    except (KeyError, ValueError) as error:  # an attribute that is missing, or no number
        raise BadInput(where, "", f"expected an attribute or a number: {error}") from None
    used = [table["agent"] for table in draft.robots.values()]
    classes = [other for other in draft.controllers.values() if f"{agents_file}:{other.class_name}" in used]
    return scenario, agents_text(experiment.name, classes), [f"{key}: {text}" for key, text in draft.notes.items()]


def _scenario(draft: Draft, experiment: Path) -> Table:
    root, arena = draft.root, _required(draft, "arena")
    settings = _required(draft, "framework/experiment")
    duration_s, seed = float(settings.get("length", 0)), int(settings.get("random_seed", 0))
    if not duration_s:
        draft.note('length="0"', f"a scenario has an end: duration_s = {ENDLESS_S:g}")
    if not seed:
        draft.note("random_seed", "a scenario has a seed: 1")
    for name in sorted(settings.attrib.keys() - {"length", "ticks_per_second", "random_seed"}):
        draft.note(f"{name} of <experiment>", "an option of swarmwire run")
    draft.controllers = read_controllers(root, draft.note)
    draft.centre = point_of(arena.get("center", "0,0,0"))
    if draft.centre != (0.0, 0.0):
        x, y = draft.centre
        draft.note(f'center="{arena.get("center")}"', f"the origin is the centre: all x are {-x:+g} m, all y {-y:+g} m")
    ground: Table = {}
    for element in arena:
        if element.tag == "floor":
            ground = _ground(draft, element, experiment)
        else:
            add_entity(draft, element, Positions(), None)
    _note_rest(draft)
    if not draft.robots:
        draft.note("<arena>", "no robots: loop functions made them; one foot-bot stands for them")
        body = Element("foot-bot", id="robot")
        add_robots(draft, body, 1, Positions(region={"how": "arena"}), None)
    size_m = size_around(draft, point_of(arena.attrib["size"]))
    tables: Table = {"size_m": list(size_m), "boundary": "open"}
    tables |= {"obstacles": draft.obstacles} if draft.obstacles else {}
    tables |= {"lights": [clear_light(draft, light) for light in draft.lights]} if draft.lights else {}
    scenario: Table = {"format": 1, "name": experiment.stem, "seed": seed or 1, "duration_s": duration_s or ENDLESS_S}
    scenario["time"] = {"rate_hz": int(settings.attrib["ticks_per_second"])}
    if root.find("physics_engines/dynamics2d") is not None:
        scenario["physics"] = {"engine": "pymunk"}  # Chipmunk, as there
    scenario |= {"arena": tables | ({"ground": ground} if ground else {}), "robots": draft.robots}
    return scenario | ({"radio": _radio(draft)} if draft.radios else {})


def _required(draft: Draft, path: str) -> Element:
    element = draft.root.find(path)
    if element is None:
        raise BadInput(draft.where, path.replace("/", "."), "is missing in the experiment")
    return element


def _radio(draft: Draft) -> Table:
    """Return [radio]: range and bearing of the robots that have it, or the Kilobot's infrared."""
    kinds = {element.tag for element in draft.radios}
    if kinds == {"kilobot"}:
        return {"preset": "kilobot"}
    radio: Table = {"preset": "infrared-epuck" if kinds <= {"e-puck", "pi-puck"} else "argos-rab"}
    ranges_m = {float(element.get("rab_range", RANGES_M.get(element.tag, 3.0))) for element in draft.radios}
    if len(ranges_m) > 1:
        draft.note("rab_range", f"one range for all robots: {max(ranges_m):g} m")
    radio["range_m"] = max(ranges_m)
    data_bytes = max(int(element.get("rab_data_size", 0)) for element in draft.radios)
    if data_bytes:
        radio["max_payload_bytes"] = data_bytes + 2  # the tag of a message
    if draft.root.find("media/range_and_bearing[@check_occlusions='false']") is not None:
        radio |= {"line_of_sight": False, "bodies_block": False}
    sensors = [other for other in draft.root.iterfind("controllers/*/sensors/*") if other.tag in RADIOS]
    losses = {float(sensor.get("packet_drop_prob", 0.0)) for sensor in sensors}
    noises_m = {float(sensor.get("noise_std_dev", 0.0)) for sensor in sensors}
    if len(losses) > 1 or len(noises_m) > 1:
        draft.note("<range_and_bearing>", "one loss and one noise for all robots: the greatest")
    if max(losses, default=0.0):
        radio["loss"] = max(losses)
    if max(noises_m, default=0.0):  # a random vector in space: half its deviation lies along the line between robots
        radio["measures"] = {"range": {"noise_m": 0.5 * max(noises_m)}, "bearing": {}}
        draft.note("noise_std_dev", "half of it is the noise of the range; bearings have none")
    return radio


def _ground(draft: Draft, element: Element, experiment: Path) -> Table:
    image = element.get("path", "")
    if element.get("source") == "image" and (experiment.parent / image).is_file():
        return {"image": str((experiment.parent / image).absolute())}
    draft.note(title_of(element), "set [arena.ground]: shades, patches or a picture beside the scenario")
    return {}


def _note_rest(draft: Draft) -> None:
    """Note the parts of the file that are no part of a scenario."""
    for element in draft.root.iterfind("loop_functions"):
        draft.note(title_of(element), "write metrics, [stop] and [[events]] in its place")
    for element in draft.root.iterfind("visualization/*"):
        draft.note(f"<{element.tag}>", "swarmwire run --view, or --ui")
        for functions in element.iterfind("user_functions"):
            draft.note(title_of(functions), "robot.note shows an agent's state in views")
    engines = draft.root.findall("physics_engines/*")
    for element in engines:
        if element.tag not in ("dynamics2d", "pointmass3d"):
            draft.note(title_of(element), "physics is two-dimensional")
    if sum(element.tag == "dynamics2d" for element in engines) > 1:
        draft.note("<physics_engines>", "one engine moves all robots on the floor")
    for element in draft.root.iterfind("media/*"):
        if element.tag not in ("led", *RADIOS):
            draft.note(title_of(element), "the only medium is [radio]")
