"""`swarmwire draw`: a picture of a scenario or a body."""

from collections.abc import Sequence
from pathlib import Path

from swarmwire.comms.base.config import from_toml, scenario_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import body_names, load_body
from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.pictures.drawing.bodies import draw_body
from swarmwire.metrics.pictures.drawing.scenario import draw_scenario
from swarmwire.world.scenario.bodies import read_body

BODY_KEYS = ("like", "drive", "radius_m")  # keys that only a body's data sheet has


def draw(subject: str, to: Path | None, seed: int | None, overrides: Sequence[str]) -> None:
    """Draw a scenario or a body: a file, a swarm's folder, or a body's name."""
    path = scenario_path(subject)
    is_scenario = path.suffix == ".toml" and not _is_sheet(path)
    if not is_scenario:
        for option, is_set in (("--seed", seed is not None), ("--set", bool(overrides))):
            if is_set:
                raise BadInput(option, "", "expected a scenario; a body has nothing to set")
    file = to or Path(f"{path.stem if path.suffix == '.toml' else subject}.png")
    if is_scenario:
        plan, world = make_plan(RunConfig(path, seed=seed, overrides=overrides))
        draw_scenario(plan.static, world.pose, plan.scenario.duration_s, file)
    elif path.suffix == ".toml":
        draw_body(read_body(path, str(path), ""), file)
    elif subject in body_names():
        draw_body(load_body(subject), file)
    else:
        expected = f"expected a scenario's or a body's .toml, or one of {', '.join(body_names())}"
        raise BadInput(subject, "", expected)
    echo(f"written: {file}")


def _is_sheet(path: Path) -> bool:
    """Return True if the file is a body's data sheet; the reader of scenarios refuses any other content."""
    try:
        table = from_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False
    return "robots" not in table and any(key in table for key in BODY_KEYS)
