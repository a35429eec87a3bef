"""The examples run as they stand."""

import subprocess
import sys
from pathlib import Path

import nbformat
import polars as pl
import pytest
from nbclient import NotebookClient

from examples.loss_sweep import FLOCK, LOSSES, table
from swarmwire.deploy import Simulation, repeat, run

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_the_sweep_has_a_row_for_each_loss_and_seed():
    runs = table(FLOCK, 2, 2.0)
    assert runs.select("loss", "seed").rows() == [(loss, seed) for loss in LOSSES for seed in (1, 2)]
    delivered = runs.group_by("loss", maintain_order=True).agg(pl.col("link_pdr").mean())["link_pdr"]
    assert delivered.is_sorted(descending=True)
    assert runs.filter(pl.col("loss") == 0.0)["link_pdr"].to_list() == [1.0, 1.0]


GAS = EXAMPLES / "gas" / "gas-leak.toml"


def test_robots_with_an_own_sense_and_an_own_actuator_seal_the_leak():
    with Simulation(GAS) as leaking:
        for _ in range(leaking.ticks):
            leaking.step()
        assert leaking.world.scene.own["leak"].strength[0] < 0.05
        assert "sealing" in leaking.world.states.names


@pytest.mark.parametrize("runners", [3, "per-robot"])
def test_the_leak_is_the_same_whoever_runs_the_agents(runners):
    short = ["duration_s=3"]
    assert run(GAS, overrides=short, runners=runners).trajectory_sha256 == run(GAS, overrides=short).trajectory_sha256


def test_the_leak_can_be_repeated_from_its_run_folder_alone(tmp_path):
    for file in GAS.parent.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    run(tmp_path / GAS.name, overrides=["duration_s=3"], out=tmp_path / "run")
    for file in tmp_path.iterdir():
        if file.is_file():
            file.unlink()
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.changes == ()
    sheet = tmp_path / "run" / "files" / "gas.py"
    sheet.write_text(sheet.read_text() + "# changed\n")
    assert repeat(tmp_path / "run").changes == ("files/gas.py is not as the run left it: its sha256 differs",)


def test_the_sweep_prints_its_table():
    command = [sys.executable, EXAMPLES / "loss_sweep.py", "--seeds", "1", "--duration", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0].split("|")[1:-1] == [" loss ", " link_pdr ", " order    ", " runs "]


# jupyter_client warns of what will change in its own event loop, tornado of the same.
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")
def test_the_notebook_runs_from_top_to_bottom(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES.parent))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    notebook = nbformat.read(EXAMPLES / "step_by_step.ipynb", as_version=4)
    NotebookClient(notebook, timeout=100, resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert outputs[-1]["data"]["text/plain"] == "True"
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    assert not [output for output in outputs if output.output_type == "error"]
