"""Every figure that is drawn of the code can be drawn; how it looks is for people to judge."""

from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from docs.pictures import epuck2_camera, parts, performance, radio_chain, robots, runner_states, tick_figure, trace
from docs.pictures.radio import sheet
from docs.pictures.radio.__main__ import FIGURES


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", FIGURES)
def test_radio_figures_can_be_drawn(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sheet, "FOLDER", tmp_path)
    FIGURES[name]()
    assert b"<svg" in (tmp_path / f"{name}.svg").read_bytes()[:1000]


DRAWN = [module.draw for module in (parts, performance, radio_chain, robots, runner_states, tick_figure, trace)]


@pytest.mark.parametrize("draw", [*DRAWN, runner_states.draw_protocol])
def test_design_figures_can_be_drawn(draw: Callable[[Path], None], tmp_path: Path):
    draw(tmp_path / "figure.svg")
    assert b"<svg" in (tmp_path / "figure.svg").read_bytes()[:1000]


def test_epuck2_camera_picture_can_be_drawn(tmp_path: Path):
    epuck2_camera.draw(tmp_path / "camera.png")
    with Image.open(tmp_path / "camera.png") as image:
        assert image.size == (640, 480)
