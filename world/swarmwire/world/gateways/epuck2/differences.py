"""In what a body that an e-puck2 could be is another one, as a program sees that takes it for an e-puck2."""

from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.bodies.sensors import Light, Proximity
from swarmwire.comms.robots.epuck2.commands import SENSES

SHOWN = 3  # angles


def differences_of(body: Body) -> tuple[str, ...]:
    """In words, each for itself; none for an e-puck2.

    >>> differences_of(load_body("epuck2"))
    ()
    """
    model = load_body("epuck2")
    return (*_looking(body, model), *_driving(body, model), *_at_rest(body, model))


def _looking(body: Body, model: Body) -> list[str]:
    pairs = [(name, body.senses.get(name), model.senses.get(name)) for name in ("proximity", "light")]
    return [
        f"its {name} looks to {_angles(its)}, not {_angles(usual)}"
        for name, its, usual in pairs
        if isinstance(its, Proximity | Light)
        and isinstance(usual, Proximity | Light)
        and its.angles_deg != usual.angles_deg
    ]


def _angles(sheet: Proximity | Light) -> str:
    return f"{', '.join(f'{angle:g}' for angle in sheet.angles_deg[:SHOWN])}, ... deg"


def _driving(body: Body, model: Body) -> list[str]:
    base_m, usual_m = body.wheels.wheel_base_m, model.wheels.wheel_base_m
    fastest, usual = body.drive.max_linear_mps, model.drive.max_linear_mps
    return [
        *([f"its wheels are {base_m:g} m apart, not {usual_m:g}"] if base_m != usual_m else []),
        *([f"it goes up to {fastest:g} m/s, not {usual:g}"] if fastest != usual else []),
    ]


def _at_rest(body: Body, model: Body) -> list[str]:
    absent = [name for name in model.senses if name in SENSES and name not in body.senses]
    return [f"it has no {', '.join(absent)}, which are told as of a robot at rest"] if absent else []
