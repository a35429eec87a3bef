"""The page on the radio shows every figure that the radio's own functions draw; drawing again gives the same bytes."""

import re
from pathlib import Path

import pytest

from docs.pictures.radio import path_loss, sheet
from docs.pictures.radio.__main__ import FIGURES
from tests.docs.pages import ROOT

SHOWN = re.findall(
    r"^!\[.+\]\(radio/(.+)\.svg\)$", (ROOT / "docs" / "radio.md").read_text(encoding="utf-8"), re.MULTILINE
)
MOST_BYTES = 100_000


def test_the_page_shows_every_figure_once():
    assert sorted(SHOWN) == sorted(FIGURES)
    assert sorted(path.stem for path in (ROOT / "docs" / "radio").iterdir()) == sorted(FIGURES)


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_a_small_picture(name: str):
    content = (ROOT / "docs" / "radio" / f"{name}.svg").read_bytes()
    assert b"<svg" in content[:1000]
    assert len(content) < MOST_BYTES


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_can_be_drawn(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sheet, "FOLDER", tmp_path)
    FIGURES[name]()
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.svg"]


def test_drawing_again_gives_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    drawn = []
    for place in (tmp_path / "one", tmp_path / "two"):
        monkeypatch.setattr(sheet, "FOLDER", place)
        path_loss.draw()
        drawn.append((place / "path-loss.svg").read_bytes())
    assert drawn[0] == drawn[1]
