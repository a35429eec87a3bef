"""Experiments are swept, digested, drawn and told by one command, and only what is missing is done again."""

import io

import polars as pl
import pytest
from rich.console import Console

from docs.experiments.__main__ import app
from docs.experiments.experiment import find_experiment, names
from docs.experiments.making import digest, digests, draw, run, run_app
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.sweep import ExecutionOptions
from tests.support.deploy.campaign import InThisProcess


def run_experiment(folders, seeds=None) -> tuple[str, str]:
    """The numbers, and what was said meanwhile."""
    output = io.StringIO()
    experiment = find_experiment("two-received", folders)
    return run(
        experiment, folders, seeds, ExecutionOptions(executor=InThisProcess()), Console(file=output)
    ), output.getvalue()


def test_experiment_runs_sweep_digest_and_draw(folders):
    numbers, output = run_experiment(folders)
    assert "2 points x 3 seeds = 6 runs" in output
    assert numbers.splitlines()[2] == "| 0 | 1.00 |"
    assert (folders.pages / "two-received.svg").read_text().count("<svg") == 1
    page = (folders.pages / "two-received.md").read_text()
    assert page == f"# Two\n\n<!-- numbers -->\n{numbers}\n<!-- /numbers -->\n\nThe end.\n"
    stored = pl.read_parquet(folders.data / "two-losses.parquet")
    assert stored.columns == [
        "run",
        "point",
        "seed",
        "radio.loss",
        "ended",
        "sim_time_s",
        "radio.link_pdr",
        "timing_wall_s",
    ]
    assert len(stored) == 6


def test_experiment_runs_only_missing_points_again(folders):
    numbers, _ = run_experiment(folders)
    assert run_experiment(folders) == (numbers, f"there already: {folders.swept / 'two-losses'}\n")
    summary = folders.swept / "two-losses" / "summary.parquet"
    pl.read_parquet(summary).head(4).write_parquet(summary)
    with pytest.raises(BadInput, match="2 of 6 runs are missing"):
        digest(find_experiment("two-received", folders), folders)
    again, output = run_experiment(folders)
    assert again == numbers
    assert "4 of them are there" in output


def test_experiment_refuses_a_finished_campaign_of_another_design(folders):
    run_experiment(folders)
    file = folders.campaigns / "two-losses.toml"
    file.write_text(file.read_text().replace("seeds = 3", "seeds = 4"))
    with pytest.raises(BadInput, match="seeds: the campaign in the folder has other seeds"):
        run_experiment(folders)


def test_experiment_with_other_seeds_leaves_the_published_page(folders):
    before = (folders.pages / "two-received.md").read_text()
    numbers, output = run_experiment(folders, "7,8")
    assert "2 points x 2 seeds" in output
    assert "| 0 | 1.00 |" in numbers
    assert (folders.pages / "two-received.md").read_text() == before
    assert not folders.data.exists()
    assert (folders.swept / "seeds-7-8" / "two-received.svg").exists()


def test_experiment_digests_any_folder_and_draws_from_digests_alone(folders, tmp_path):
    run_experiment(folders)
    experiment = find_experiment("two-received", folders)
    elsewhere = (folders.swept / "two-losses").rename(tmp_path / "elsewhere")
    (folders.data / "two-losses.parquet").unlink()
    with pytest.raises(BadInput, match="run or digest two-received first"):
        draw(experiment, folders)
    digest(experiment, folders, [elsewhere])
    assert draw(experiment, folders).startswith("| loss | received |")
    assert len(digests(experiment, folders)["two-losses"]) == 6


def test_experiment_may_define_its_own_digest(folders):
    file = folders.figures / "two_received.py"
    code = 'def digested(folder, runs):\n    return runs.tail(3).select("radio.loss", "radio.link_pdr")'
    file.write_text(f"{file.read_text()}\n\n{code}\n")
    numbers, _ = run_experiment(folders)
    assert len(numbers.splitlines()) == 3
    assert pl.read_parquet(folders.data / "two-losses.parquet").shape == (3, 2)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'COLUMNS = ("radio.link_pdr",)',
            'COLUMNS = ("radio.link_pdf",)',
            "radio.link_pdf: .*radio.link_pdr \\(did you mean this",
        ),
        ('COLUMNS = ("radio.link_pdr",)', "", "COLUMNS: is missing"),
    ],
)
def test_experiment_with_a_missing_or_unknown_column_is_refused(folders, old, new, message):
    file = folders.figures / "two_received.py"
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(BadInput, match=message):
        run_experiment(folders)


def test_experiment_page_needs_one_mark_for_the_numbers(folders):
    (folders.pages / "two-received.md").write_text("# Two\n")
    with pytest.raises(BadInput, match="expected one line <!-- numbers -->"):
        run_experiment(folders)


def test_experiment_that_is_unknown_is_refused_with_a_suggestion(folders, tmp_path):
    assert names(folders) == ("two-received",)
    with pytest.raises(BadInput, match="two-received \\(did you mean this"):
        find_experiment("two-receive", folders)
    with pytest.raises(BadInput, match="expected a campaign's folder"):
        digest(find_experiment("two_received", folders), folders, [tmp_path / "two-losses"])


def test_experiment_errors_are_one_line(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["experiments", "draw", "no-such"])
    with pytest.raises(SystemExit) as ended:
        run_app(app)
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("error: NAME: no-such: unknown experiment")
