"""A metric of the user's own, named by a scenario, is part of the run and of what is kept of it."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, Simulation, repeat, run
from swarmwire.metrics.drawing.film import film_of
from tests.docs.pages import files_of
from tests.support.deploy.layouts import run_spread
from tests.support.metrics.packages import CODE, install

FROM_ZERO = "metrics.1.from_m=0.0"
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


@pytest.mark.parametrize("runners", [None, 2])
def test_it_is_in_summary_and_table_and_in_a_repetition_from_the_run_folder_alone(tmp_path, scenario, runners):
    result = run_spread(scenario, runners, out=tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    ticks = folder.metrics()
    assert list(folder.measured) == list(result.metrics)
    assert (folder.measured["spread"].unit, film_of(folder, 0, "").facts["spread"].kind) == ("m", "level")
    assert result.metrics["spread"].final == ticks["spread"][-1] > 0.0
    (tmp_path / "spread.py").unlink()
    again = repeat(tmp_path / "run", out=tmp_path / "again")
    assert again.same
    assert again.changes == ()
    assert RunFolder(tmp_path / "again").metrics()["spread"].equals(ticks["spread"])


def test_its_parameters_are_kept_with_the_run(tmp_path, scenario):
    (tmp_path / "spread.py").write_text(CODE)
    listed = 'metrics=["order", { metric = "spread.py:East", from_m = 1.0 }]'
    result = run(scenario, overrides=[listed, "metrics.1.from_m=2.0"], out=tmp_path / "run")
    (tmp_path / "spread.py").unlink()
    again = repeat(tmp_path / "run")
    assert again.changes == ()
    assert again.result.metrics["east"] == result.metrics["east"]
    east, two_metres_on = (run(tmp_path / "run" / "scenario.toml", overrides=over) for over in ([], [FROM_ZERO]))
    assert two_metres_on.metrics["east"].final == pytest.approx((east.metrics["east"].final or 0.0) + 2.0)


def test_a_package_brings_one_by_name_and_its_code_is_told_with_the_run(tmp_path, scenario, monkeypatch):
    install(tmp_path / "site", "wind_metrics", {"east": "East"})
    monkeypatch.syspath_prepend(tmp_path / "site")
    result = run(scenario, overrides=['metrics=["east"]'], out=tmp_path / "run")
    assert "wind_metrics" in result.facts.modules
    assert RunFolder(tmp_path / "run").metrics()["east"][-1] == result.metrics["east"].final
    assert repeat(tmp_path / "run").changes == ()
    (tmp_path / "site" / "wind_metrics.py").write_text(CODE + "# a word more\n")
    (change,) = repeat(tmp_path / "run").changes
    assert "wind_metrics" in change


@pytest.mark.parametrize("names", [[], ["order"]])
def test_without_the_standard_ones_a_run_has_those_that_are_listed(tmp_path, scenario, names):
    settings = [f"metrics={names}", "standard_metrics=false"]
    result = run(scenario, overrides=settings, out=tmp_path / "run")
    assert list(result.metrics) == names
    assert RunFolder(tmp_path / "run").metrics().columns == ["tick", "time_s", *names, "sent", "received", "in_range"]
    assert result.record["ticks"]["rows"] == 10
    assert not [name for name in result.counts if name.startswith("observer_failed")]
    assert result.trajectory_sha256 == run(scenario).trajectory_sha256


def test_it_changes_nothing_of_the_run(scenario):
    assert run(scenario).trajectory_sha256 == run(scenario, overrides=["metrics=[]"]).trajectory_sha256


def test_one_that_is_not_there_is_refused_before_the_run(scenario):
    with pytest.raises(BadInput, match=r"s.toml: metrics\.0: .*'None'"):
        Simulation(scenario, overrides=['metrics=["spread.py:None"]'])
