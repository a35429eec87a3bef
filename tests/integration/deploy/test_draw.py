"""`swarmwire draw`, in this process: its pictures, and what it refuses."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from swarmwire.comms.robot.bodies.body import body_names
from swarmwire.deploy.cli.app import app
from tests.support.deploy.runs import LOSSY, ROOT
from tests.support.refusals import refused_input

pytest.importorskip("matplotlib", reason="needs the extra [report]")
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))
E_PUCK_BLUE = (86, 180, 233)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def draw(*arguments) -> str:
    ended = CliRunner().invoke(app, ["draw", *map(str, arguments)], catch_exceptions=False)
    assert ended.exit_code == 0, ended.output
    return ended.output


def pixels(path):
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
def test_scenario_drawing_exists_for_every_shipped_scenario(folder, scenario):
    assert draw(scenario) == f"written: {scenario.stem}.png\n"
    image = pixels(folder / f"{scenario.stem}.png")
    assert max(image.shape) == 1280
    assert (image == E_PUCK_BLUE).all(axis=2).any()


def test_floor_is_drawn_in_greys(folder):
    draw(ROOT / "scenarios" / "maze.toml", "--to", "maze.png")
    spot = (pixels(folder / "maze.png") == round(255 * (0.45 + 0.55 * 0.2))).all(axis=2)
    assert spot.sum() > 1000


def test_another_seed_or_setting_is_another_picture(folder):
    draw(LOSSY, "--to", "a.png")
    draw(LOSSY, "--to", "b.png", "--seed", "2")
    draw(LOSSY, "--to", "c.png", "--set", "radio.range_m=1")
    draw(LOSSY, "--to", "d.png")
    a, b, c, d = (pixels(folder / f"{name}.png") for name in "abcd")
    assert (a == d).all()
    assert (a != b).any()
    assert (a != c).any()


def test_bodies_are_drawn_by_name_and_by_data_sheet(folder):
    assert draw("epuck") == "written: epuck.png\n"
    (folder / "wide.toml").write_text('like = "epuck"\nname = "wide"\nsource = "a test"\nradius_m = 0.05\n')
    assert draw("wide.toml") == "written: wide.png\n"
    assert pixels(folder / "wide.png").shape[1] == 900


def test_drawing_may_be_svg(folder):
    draw("footbot", "--to", "a.svg")
    assert "</svg>" in (folder / "a.svg").read_text()


@pytest.mark.parametrize(
    ("arguments", "where", "expected"),
    [
        (["blimp"], "blimp", ", ".join(body_names())),
        (["absent.toml"], "absent.toml", "file"),
        (["epuck", "--seed", "2"], "--seed", "scenario"),
        (["epuck", "--set", "mass_kg=2"], "--set", "scenario"),
        (["epuck", "--to", "a.bmp"], "a.bmp", ".png or .svg or .pdf"),
        (["epuck", "--to", "absent/a.png"], "absent/a.png", "folder"),
        ([LOSSY, "--seed", "-1"], "--seed", "0 to 9223372036854775807"),
        (["thin.toml"], "thin.toml: radius_m", "-1.0"),
    ],
)
def test_draw_arguments_that_are_invalid_are_refused(folder, arguments, where, expected):
    (folder / "thin.toml").write_text('like = "epuck"\nradius_m = -1\n')
    with refused_input(match=f"^{re.escape(str(where))}: .*{re.escape(expected)}"):
        draw(*arguments)
    assert not [*folder.glob("*.png"), *folder.glob("*.bmp")]
