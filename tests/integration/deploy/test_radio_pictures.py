"""The pictures of `swarmwire radio`: of a fit, and of the coverage of a scenario's radio."""

import json
import math
import tomllib

import pytest

from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Shadowing
from tests.integration.deploy.radio.test_probe import WALLED, said
from tests.integration.deploy.radio.test_radio_fit import here, rows
from tests.support.deploy.commands import LOSSY, called
from tests.support.metrics.radio_fit.synthetic import csv_of, made

__all__ = ["here"]  # in whose folder all of these tests are


def test_a_log_becomes_a_table_a_picture_and_what_stands_in_a_scenario(here, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    (here / "log.csv").write_text(csv_of(made(1, Shadowing(4.0, 5.0), Bursts(0.5, 5.0), packets=60)))
    to = ["--to", "fit.png", "--write", "radio.toml", "--power-dbm", "4", "--size", "400"]
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", *to)
    assert (code, errors) == (0, "")
    for words in ("path loss exponent", "standard error", "correlation distance", "bursts: mean", "root mean square"):
        assert words in out
    assert out.endswith("written: fit.png\nwritten: radio.toml\n")
    assert (here / "fit.png").read_bytes().startswith(b"\x89PNG")
    radio = tomllib.loads((here / "radio.toml").read_text())["radio"]
    assert sorted(radio) == ["antenna", "bursts", "log_distance", "model", "shadowing"]
    assert 42.0 < radio["log_distance"]["reference_loss_db"] < 46.0


@pytest.mark.parametrize("farthest_m", [2.0, 9.0, 15.5, 400.0, 1e6])
def test_the_picture_has_distances_to_read_off(here, monkeypatch, capsys, farthest_m):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    from swarmwire.metrics.drawing import canvas, radio_fit

    drawn = []
    monkeypatch.setattr(radio_fit, "save", lambda figure, to: (drawn.append(figure), canvas.save(figure, to)))
    step = math.log10(farthest_m / 1.2) / 19
    (here / "log.csv").write_text(rows(20, lambda i: -50 - 30 * step * i, lambda i: 1.2 * 10.0 ** (step * i)))
    code, _, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", "--to", "fit.png", "--size", "400")
    assert (code, errors) == (0, "")
    axis, (low, high) = drawn[0].axes[0].xaxis, drawn[0].axes[0].get_xlim()
    shown = [label.get_text() for label in axis.get_ticklabels() if low <= label.get_position()[0] <= high]
    assert 2 <= len([text for text in shown if text]) <= 20


def test_people_get_a_table_and_a_picture(tmp_path):
    text = said(WALLED, "--to", tmp_path / "coverage.png", "--size", "400")
    assert "sensitivity -101.0 dBm" in text
    assert "% of the arena in range" in text
    assert max(len(line) for line in text.splitlines() if "│" in line) <= 80
    assert text.splitlines()[-1] == f"written: {tmp_path / 'coverage.png'}"
    assert (tmp_path / "coverage.png").read_bytes().startswith(b"\x89PNG")
    json.loads(said(LOSSY, "--json", "--to", tmp_path / "disk.svg").splitlines()[0])
    assert "</svg>" in (tmp_path / "disk.svg").read_text()
