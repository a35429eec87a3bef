"""A metric of the user's own, named by a scenario, is part of the run and of what is kept of it."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, Simulation, repeat, run
from tests.docs.pages import files_of

SCENARIO = """
format = 1
name = "spread"
duration_s = 1.0
metrics = ["spread.py:Spread"]
[arena]
size_m = [4.0, 4.0]
[robots.a]
body = "epuck"
count = 3
agent = "swarmwire.agent.behaviours:Avoidance"
"""


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "spread.py").write_text(files_of("docs/api/metrics.md")["spread.py"])
    (tmp_path / "s.toml").write_text(SCENARIO)
    return tmp_path / "s.toml"


@pytest.mark.parametrize("runners", ["none", 2])
def test_it_is_in_summary_and_table_and_in_a_repetition_from_the_run_folder_alone(tmp_path, scenario, runners):
    result = run(scenario, runners=runners, out=tmp_path / "run")
    ticks = RunFolder(tmp_path / "run").metrics()
    assert result.metrics["spread"].final == ticks["spread"][-1] > 0.0
    (tmp_path / "spread.py").unlink()
    again = repeat(tmp_path / "run", out=tmp_path / "again")
    assert again.same
    assert again.changes == ()
    assert RunFolder(tmp_path / "again").metrics()["spread"].equals(ticks["spread"])


def test_it_changes_nothing_of_the_run(scenario):
    assert run(scenario).trajectory_sha256 == run(scenario, overrides=["metrics=[]"]).trajectory_sha256


def test_one_that_is_not_there_is_refused_before_the_run(scenario):
    with pytest.raises(BadInput, match=r"s.toml: metrics\.0: .* holds no such name: 'None'"):
        Simulation(scenario, overrides=['metrics=["spread.py:None"]'])
