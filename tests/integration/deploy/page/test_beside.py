"""A run that waits for its page goes on without it where it cannot be had; without the extra nothing begins."""

import io
import sys

import psutil
import pytest
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import UI
from swarmwire.deploy.page.beside import PageBeside
from swarmwire.deploy.simulation import Simulation, finished
from tests.support.deploy.commands import LOSSY, called
from tests.support.waiting import until


@pytest.mark.parametrize("command", [["/none/such"], [sys.executable, "-c", "import sys; sys.exit('no page today')"]])
def test_a_run_whose_page_cannot_be_had_goes_on_by_itself(tmp_path, command, monkeypatch, capsys):
    out = io.StringIO()
    simulation = Simulation(LOSSY, overrides=["duration_s=0.5"], out=tmp_path / "run")
    with PageBeside(simulation, tmp_path / "run", Console(file=out, width=40)) as page:
        monkeypatch.setattr(page, "_command", command)
        simulation.watch(page)
        result = finished(simulation)
    assert (result.ended, result.ticks) == ("duration", 5)
    assert "no live view" in capsys.readouterr().err or out.getvalue() == "no page today\n"


@pytest.mark.parametrize(("paused", "held"), [(True, "paused: swarmwire ctl resume"), (False, "going on")])
def test_a_page_that_is_killed_ends_no_run_and_what_can_be_done_is_said(tmp_path, monkeypatch, paused, held):
    out = io.StringIO()
    simulation = Simulation(LOSSY, overrides=["duration_s=1"], out=tmp_path / "run")
    page = PageBeside(simulation, tmp_path / "run", Console(file=out))
    monkeypatch.setattr(page, "_command", [sys.executable, "-c", "import sys; sys.stdin.read()"])
    simulation.watch(page)
    with page, simulation:
        simulation.step()
        simulation.step()
        if not paused:
            simulation.controls.resume()
        assert page.pid is not None
        psutil.Process(page.pid).kill()
        until(lambda: out.getvalue().endswith("\n"))
        assert f"the run is {held}" in out.getvalue()
        assert "swarmwire ui" in out.getvalue()
        simulation.controls.set_speed(None)
        simulation.controls.resume()
        simulation.run()
    assert simulation.result.ended == "duration"


def test_a_run_begins_paused_at_the_speed_of_the_wall_clock(tmp_path, monkeypatch):
    simulation = Simulation(LOSSY, overrides=["duration_s=0.5"], out=tmp_path / "run")
    page = PageBeside(simulation, tmp_path / "run", Console(quiet=True))
    monkeypatch.setattr(page, "_command", [sys.executable, "-c", "import sys; sys.stdin.read()"])
    simulation.watch(page)
    with page, simulation:
        assert simulation.controls.paused
        assert simulation.controls.speed == 1.0
        simulation.controls.resume()
        simulation.run()
    assert simulation.result.ended == "duration"


def test_without_the_extra_it_is_named_and_no_folder_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("swarmwire.comms.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r'ui: needs fastapi and uvicorn: pip install "swarmwire\[ui\]"'):
        UI.need("ui")
    code, _, errors = called(monkeypatch, capsys, "run", LOSSY, "--ui", "--out", tmp_path / "run")
    assert (code, errors) == (2, 'error: --ui: needs fastapi and uvicorn: pip install "swarmwire[ui]"\n')
    assert not (tmp_path / "run").exists()


def test_a_page_of_no_run_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("RUST_LOG", "off")
    for arguments in ([], ["3f2a"], [str(tmp_path)]):
        code, _, errors = called(monkeypatch, capsys, "ui", *arguments)
        assert code == 2
        assert errors.startswith("error: ")
        assert "run that goes on" in errors
        assert errors.count("\n") == 1
