"""A campaign's folder that a power cut or a person has damaged: one line that says which file, and how to go on."""

import json
from shutil import copytree

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaign import store
from swarmwire.deploy.campaign import sweep as sweeping
from swarmwire.deploy.repetition import CampaignRun
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import read_campaign
from tests.integration.deploy.campaign.test_resume import VARY, Killed, dying_at
from tests.support.damaged import damaged
from tests.support.deploy.campaign import InThisProcess, rows_in, scenario_in, series_in

ASKED_SINGLY = {"seeds": 2, "vary": VARY, "batch": 1}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A folder with a campaign that is `whole`, and with one of which two of four tasks are done, `half`."""
    folder = tmp_path_factory.mktemp("sound")
    scenario = scenario_in(folder)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        sweep(scenario, out=folder / "whole", **ASKED_SINGLY)
        dying_at(patched, 4, Killed())
        with pytest.raises(Killed):
            sweep(scenario, out=folder / "half", **ASKED_SINGLY)
        patched.undo()
        patched.setenv("RUST_BACKTRACE", "0")  # to name the functions of a panic takes seconds
        yield folder


@pytest.fixture
def whole(sound, tmp_path, here):
    """A copy, for one test to damage."""
    return copytree(sound / "whole", tmp_path / "whole")


@pytest.fixture
def half(sound, tmp_path, here):
    """A copy, for one test to damage."""
    return copytree(sound / "half", tmp_path / "half")


def refused(call, *arguments):
    with pytest.raises(BadInput) as told:
        call(*arguments)
    assert "\n" not in str(told.value)
    assert told.value.expected
    return told.value


def at(error):
    """The file and the key that an error names."""
    return error.where, error.key


def taken_up(folder):
    """What `resume` reads and joins before and after it runs what is missing."""
    its = store.CampaignFolder(folder, read_campaign(folder))
    its.clear()
    its.finish(2)


def faults_told(calls, *arguments):
    """The errors of those of the calls that refuse what they find."""
    for call in calls:
        try:
            call(*arguments)
        except BadInput as error:
            yield error


@settings(max_examples=12)  # each copies a folder; what is read of one file has a test beside `read_whole`
@given(of=st.data())
def test_wherever_a_file_is_damaged_one_line_names_it_or_nothing_is_wrong(sound, tmp_path_factory, of):
    file = of.draw(st.sampled_from(sorted(path.relative_to(sound) for path in sound.rglob("*.parquet"))))
    data = of.draw(damaged((sound / file).read_bytes()))
    folder = copytree(sound / file.parts[0], tmp_path_factory.mktemp("damaged") / file.parts[0])
    (folder.parent / file).write_bytes(data)
    tables = [str(path) for path in folder.rglob("*.parquet")]
    read, again = lambda of: CampaignFolder(of).runs, lambda of: CampaignRun(of, 1)._before()
    for told in faults_told((read, again, taken_up), folder):
        assert told.where in tables
        assert "\n" not in str(told)


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + b"x" * 400 + b"PAR1"])  # none is a whole Parquet file
def test_a_damaged_part_is_told_by_its_name_and_without_it_its_runs_are_run_again(half, whole, data):
    part = half / "parts" / "part-00000001.parquet"
    part.write_bytes(data)
    for call in (resume, lambda folder: CampaignRun(folder, 1).run()):
        assert refused(call, half).where == str(part)
    part.unlink()
    assert resume(half).is_over
    assert rows_in(half) == rows_in(whole)
    assert series_in(half).equals(series_in(whole), null_equal=True)


def test_a_damaged_series_is_told_by_its_name_and_without_it_the_table_is_whole(half, whole):
    part = next((half / "series").glob("part-*"))
    part.write_bytes(b"")
    assert refused(resume, half).where == str(part)
    part.unlink()
    assert resume(half).is_over
    assert rows_in(half) == rows_in(whole)


def test_series_of_another_type_are_told_by_file_and_column(half):
    first, second = sorted((half / "series").glob("part-*"))
    pl.read_parquet(second).with_columns(pl.col("order").cast(pl.String)).write_parquet(second)
    its = store.CampaignFolder(half, read_campaign(half))
    assert at(refused(its.finish, 1)) == (str(second), "order")
    assert first.exists()


def test_a_table_of_another_campaign_is_told_by_the_first_strange_column(half):
    part = half / "parts" / "part-00000000.parquet"
    rows = pl.read_parquet(part)
    for frame, column, expected in (
        (rows.drop("order.mean"), "order.mean", "Float64"),
        (rows.with_columns(pl.col("seed").cast(pl.String)), "seed", "Int"),
        (rows.with_columns(run=pl.col("run") + 8), "run", "0 to 3"),
    ):
        frame.write_parquet(part)
        error = refused(resume, half)
        assert at(error) == (str(part), column)
        assert expected in error.expected


def test_files_of_others_in_the_folder_are_left_alone(half, whole):
    for stray in ("parts/.nfs0001", "parts/part-mine.parquet", "series/part-mine.parquet"):
        (half / stray).write_text("mine")
    assert resume(half).is_over
    assert (half / "parts" / "part-mine.parquet").read_text() == "mine"
    assert rows_in(half) == rows_in(whole)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("seeds", []),
        ("seeds", [1, 1]),
        ("seeds", ["a", "b"]),
        ("points", []),
        ("points", [{"a": 0.0}, {"a": 1.0}]),
        ("point_overrides", [["radio.loss=0"]]),
        ("point_overrides", [[1], [2]]),
        ("robots", 0),
        ("robots", "two"),
        ("batch", "few"),
        ("record_seeds", [77]),
        ("versions", []),
        ("responses", [{"column": "order.final", "unit": "", "kind": "tome", "help": ""}]),
    ],
)
def test_what_campaigns_never_say_is_refused_by_its_key(whole, key, value):
    about = whole / "campaign.json"
    about.write_text(json.dumps({**json.loads(about.read_text()), key: value}))
    for error in (refused(resume, whole), refused(CampaignRun, whole, 0)):
        assert (error.where, error.key.startswith(key)) == (str(about), True)


def test_a_campaign_that_lacks_any_key_is_refused(whole):
    about = whole / "campaign.json"
    found = json.loads(about.read_text())
    for key in found:
        about.write_text(json.dumps({name: value for name, value in found.items() if name != key}))
        assert refused(read_campaign, whole).where == str(about)


def test_a_campaign_that_ended_before_its_first_run_says_what_to_do(half):
    (half / "campaign.json").unlink()
    error = refused(resume, half)
    assert error.where == str(half)
    assert "begin again" in error.expected


def test_a_summary_beside_unreadable_others_is_kept(whole):
    before = (whole / "summary.parquet").read_bytes()
    (whole / "parts").mkdir()
    (whole / "parts" / "part-00000000.parquet").write_bytes(b"")
    refused(resume, whole)
    assert (whole / "summary.parquet").read_bytes() == before


def test_a_package_that_is_no_more_has_changed(whole):
    about = whole / "campaign.json"
    found = json.loads(about.read_text())
    about.write_text(json.dumps({**found, "modules": {**found["modules"], "gone_away": "0"}}))
    assert "gone_away" in str(refused(resume, whole))
    (change,) = CampaignRun(whole, 0).run().changes
    assert "gone_away" in change


@pytest.mark.parametrize(("name", "value"), [("order.final", "much"), ("ended", None), ("run", None)])
def test_reports_refuse_a_table_of_other_types_by_its_column(whole, name, value):
    table = whole / "summary.parquet"
    pl.read_parquet(table).with_columns(pl.lit(value, pl.String).alias(name)).write_parquet(table)
    assert at(refused(lambda: CampaignFolder(whole).runs)) == (str(table), name)
