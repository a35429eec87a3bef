"""A campaign that was ended is resumed; one with damaged files is refused or mended."""

import errno
import hashlib
import json
import re
from shutil import copytree

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.atomic import folder_lock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaigns import store
from swarmwire.deploy.campaigns import sweep as sweeping
from swarmwire.deploy.campaigns.repetition import CampaignRun
from swarmwire.deploy.campaigns.store import StorageFailed
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from tests.support.deploy.campaign import InThisProcess, rows_in, scenario_in, series_in
from tests.support.metrics.recorded import damaged
from tests.support.refusals import refused_input

VARY = {"radio.loss": [0.0, 0.5]}
OPTIONS = {"seeds": 2, "vary": VARY, "batch": 2}
WRITES = 5  # two tasks of rows and series each, and the table
FULL = OSError(errno.ENOSPC, "No space left on device")
SINGLE_OPTIONS = {"seeds": 2, "vary": VARY, "batch": 1}


class Killed(BaseException):
    """Stands for a process that is no more."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A campaign that was left alone."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        sweep(scenario_in(folder, "stumbling.py:Stumbling"), out=folder / "whole", **OPTIONS)
    return folder / "whole"


@pytest.fixture
def campaign(undisturbed, tmp_path, executors):
    """A copy of it."""
    return copytree(undisturbed, tmp_path / "whole")


def dying_at(monkeypatch, count, error):
    """The write of this number, counted from 0, is the last that is tried; how many there were."""
    write, tried = store._write, []

    def dying(path, data):
        tried.append(path)
        if len(tried) > count:
            raise error
        write(path, data)

    monkeypatch.setattr(store, "_write", dying)
    return tried


def same(folder, campaign):
    assert rows_in(folder) == rows_in(campaign)
    assert series_in(folder).equals(series_in(campaign), null_equal=True)
    assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in campaign.iterdir())


@pytest.mark.parametrize("count", range(WRITES))
def test_whichever_write_was_the_last_nothing_is_lost_or_there_twice(tmp_path, stumbling, campaign, monkeypatch, count):
    folder = tmp_path / "died"
    with monkeypatch.context() as patched:
        tried = dying_at(patched, count, Killed())
        with pytest.raises(Killed):
            sweep(stumbling, out=folder, **OPTIONS)
    assert len(tried) == count + 1
    before, rows = rows_in(folder), rows_in(campaign)
    assert len(before) == 2 * (count // 2)
    assert all(row in rows for row in before)
    assert resume(folder).is_over
    same(folder, campaign)


def test_resume_runs_only_what_is_missing(campaign, executors):
    (campaign / "summary.parquet").unlink()
    assert resume(campaign).done == 4
    assert resume(campaign).is_over
    assert [len(executor.tasks) for executor in executors] == [0, 0]


def test_failed_runs_stay_unless_they_are_to_be_tried_again(tmp_path, campaign):
    rows = rows_in(campaign)
    failed = [row["run"] for row in rows if row["ended"] == "failed"]
    assert failed
    assert resume(campaign).failed == len(failed)
    agent = campaign / "scenario" / "files" / "stumbling.py"
    spec = read_campaign(campaign)
    agent.write_text(agent.read_text().replace("< self.share", "< 0.0"))
    with refused_input(match="scenario/files/stumbling.py"):
        resume(campaign, retry_failed=True)
    _say_as_it_is_now(campaign, agent)
    done = resume(campaign, retry_failed=True)
    assert (done.is_over, done.failed) == (True, 0)
    assert [row for row in rows_in(campaign) if row["run"] not in failed] == [
        row for row in rows if row["run"] not in failed
    ]
    assert set(series_in(campaign)["run"]) == set(range(spec.runs))
    assert len(series_in(campaign)) == 5 * spec.runs


def _say_as_it_is_now(folder, agent):
    about = json.loads((folder / "campaign.json").read_text())
    for file in about["files"]:
        if file["path"].endswith(agent.name):
            file["sha256"] = hashlib.sha256(agent.read_bytes()).hexdigest()
    (folder / "campaign.json").write_text(json.dumps(about))


def test_other_code_and_versions_are_refused_unless_people_insist(campaign):
    about = json.loads((campaign / "campaign.json").read_text())
    for key, value, text in (
        ("modules", {**about["modules"], "swarmwire.world": "0"}, "swarmwire.world"),
        ("modules", {**about["modules"], "gone_away": "0"}, "gone_away"),  # a package that is no longer installed
        ("versions", {**about["versions"], "numpy": "1.0"}, r"numpy.* 1\.0"),
    ):
        (campaign / "campaign.json").write_text(json.dumps({**about, key: value}))
        with refused_input(f"--resume {campaign}", match=f"{text}.*--force"):
            resume(campaign)
        assert resume(campaign, force=True).is_over
        (change,) = CampaignRun(campaign, 0).run().changes
        assert re.search(text, change)


@pytest.mark.parametrize("text", [None, "{", "[]", '{"format": 1}', '{"format": 2}'])
def test_folder_without_a_campaign_is_refused_in_a_line(tmp_path, text):
    if text is not None:
        (tmp_path / "campaign.json").write_text(text)
    with refused_input(match=f"^{tmp_path}"):
        resume(tmp_path)


def test_campaign_folder_is_for_one_process_at_a_time(campaign):
    with folder_lock(campaign, "campaign"), refused_input(match="another process is at work"):
        resume(campaign)


def test_full_disk_loses_no_finished_runs_of_a_sweep(tmp_path, scenario, executors, monkeypatch):
    folder, count = tmp_path / "c", 3
    with monkeypatch.context() as patched:
        dying_at(patched, count, FULL)
        with pytest.raises(StorageFailed) as error:
            sweep(scenario, out=folder, **OPTIONS)
    assert re.match(f"{folder}: .*No space left on device.*swarmwire sweep --resume {folder}$", str(error.value))
    assert len(rows_in(folder)) == 2 * (count // 2)
    assert executors[0].closed
    assert resume(folder).is_over
    assert len(rows_in(folder)) == 4


def test_series_that_cannot_be_joined_are_no_loss_either(tmp_path, scenario, executors, monkeypatch):
    sink = pl.LazyFrame.sink_parquet

    def full(frame, path, **options):
        if "worker-" in str(path):
            raise pl.exceptions.ComputeError("No space left on device (os error 28)")
        return sink(frame, path, **options)

    with monkeypatch.context() as patched:
        patched.setattr(pl.LazyFrame, "sink_parquet", full)
        with pytest.raises(StorageFailed, match="No space left"):
            sweep(scenario, out=tmp_path / "c", **OPTIONS)
    assert len(rows_in(tmp_path / "c")) == 4
    assert not list((tmp_path / "c" / "series").glob("worker-*"))
    assert resume(tmp_path / "c").is_over
    assert "series" in [path.name for path in (tmp_path / "c").iterdir()]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A folder with a campaign that is `whole`, and with one of which two of four tasks are done, `half`."""
    folder = tmp_path_factory.mktemp("sound")
    scenario = scenario_in(folder)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        sweep(scenario, out=folder / "whole", **SINGLE_OPTIONS)
        dying_at(patched, 4, Killed())
        with pytest.raises(Killed):
            sweep(scenario, out=folder / "half", **SINGLE_OPTIONS)
        patched.undo()
        patched.setenv("RUST_BACKTRACE", "0")  # to name the functions of a panic takes seconds
        yield folder


@pytest.fixture
def untouched(sound, tmp_path, executors):
    """A copy, for one test to damage."""
    return copytree(sound / "whole", tmp_path / "whole")


@pytest.fixture
def half(sound, tmp_path, executors):
    """A copy, for one test to damage."""
    return copytree(sound / "half", tmp_path / "half")


def taken_up(folder):
    """What `resume` reads and joins before and after it runs what is missing."""
    its = store.CampaignWriter(folder, read_campaign(folder))
    its.clear()
    its.finish(2)


def errors_of(calls, *arguments):
    """The errors of those of the calls that refuse what they find."""
    for call in calls:
        try:
            call(*arguments)
        except BadInput as error:
            yield error


@settings(max_examples=12)  # each copies a folder; what is read of one file has a test beside `read_whole`
@given(draws=st.data())
def test_wherever_a_file_is_damaged_one_line_names_it_or_nothing_is_wrong(sound, tmp_path_factory, draws):
    file = draws.draw(st.sampled_from(sorted(path.relative_to(sound) for path in sound.rglob("*.parquet"))))
    data = draws.draw(damaged((sound / file).read_bytes()))
    folder = copytree(sound / file.parts[0], tmp_path_factory.mktemp("damaged") / file.parts[0])
    (folder.parent / file).write_bytes(data)
    tables = [str(path) for path in folder.rglob("*.parquet")]
    read, again = lambda path: CampaignFolder(path).runs, lambda path: CampaignRun(path, 1)._before()
    for error in errors_of((read, again, taken_up), folder):
        assert error.where in tables
        assert "\n" not in str(error)


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + b"x" * 400 + b"PAR1"])  # none is a whole Parquet file
def test_damaged_part_is_named_and_its_runs_run_again_without_it(half, untouched, data):
    part = half / "parts" / "part-00000001.parquet"
    part.write_bytes(data)
    for call in (resume, lambda folder: CampaignRun(folder, 1).run()):
        with refused_input(part):
            call(half)
    part.unlink()
    assert resume(half).is_over
    assert rows_in(half) == rows_in(untouched)
    assert series_in(half).equals(series_in(untouched), null_equal=True)


def test_damaged_series_is_named_and_the_table_is_whole_without_it(half, untouched):
    part = next((half / "series").glob("part-*"))
    part.write_bytes(b"")
    with refused_input(part):
        resume(half)
    part.unlink()
    assert resume(half).is_over
    assert rows_in(half) == rows_in(untouched)


def test_series_of_another_type_are_told_by_file_and_column(half):
    first, second = sorted((half / "series").glob("part-*"))
    pl.read_parquet(second).with_columns(pl.col("order").cast(pl.String)).write_parquet(second)
    its = store.CampaignWriter(half, read_campaign(half))
    with refused_input(second, "order"):
        its.finish(1)
    assert first.exists()


def test_table_of_another_campaign_is_refused_with_file_and_column(half):
    part = half / "parts" / "part-00000000.parquet"
    rows = pl.read_parquet(part)
    for frame, column, expected in (
        (rows.drop("order.mean"), "order.mean", "Float64"),
        (rows.with_columns(pl.col("seed").cast(pl.String)), "seed", "Int"),
        (rows.with_columns(run=pl.col("run") + 8), "run", "0 to 3"),
    ):
        frame.write_parquet(part)
        with refused_input(part, column, expected):
            resume(half)


def test_files_of_others_in_the_folder_are_left_alone(half, untouched):
    for stray in ("parts/.nfs0001", "parts/part-mine.parquet", "series/part-mine.parquet"):
        (half / stray).write_text("mine")
    assert resume(half).is_over
    assert (half / "parts" / "part-mine.parquet").read_text() == "mine"
    assert rows_in(half) == rows_in(untouched)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("point_overrides", [["radio.loss=0"]]),
        ("point_overrides", [[1], [2]]),
        ("robots", 0),
        ("robots", "two"),
        ("batch", "few"),
        ("record_seeds", [77]),
        ("versions", []),
    ],
)
def test_campaign_json_with_an_invalid_key_is_refused(untouched, key, value):
    about = untouched / "campaign.json"
    about.write_text(json.dumps({**json.loads(about.read_text()), key: value}))
    for call in (resume, lambda folder: CampaignRun(folder, 0)):
        with refused_input(about, match=f": {key}"):
            call(untouched)


def test_campaign_json_without_any_one_key_is_refused(untouched):
    about = untouched / "campaign.json"
    content = json.loads(about.read_text())
    for key in content:
        about.write_text(json.dumps({name: value for name, value in content.items() if name != key}))
        with refused_input(about):
            read_campaign(untouched)


def test_campaign_that_ended_before_its_first_run_says_to_begin_again(half):
    (half / "campaign.json").unlink()
    with refused_input(half, match="begin again"):
        resume(half)


def test_summary_beside_unreadable_parts_is_kept(untouched):
    before = (untouched / "summary.parquet").read_bytes()
    (untouched / "parts").mkdir()
    (untouched / "parts" / "part-00000000.parquet").write_bytes(b"")
    with refused_input():
        resume(untouched)
    assert (untouched / "summary.parquet").read_bytes() == before


@pytest.mark.parametrize(("name", "value"), [("order.final", "much"), ("ended", None), ("run", None)])
def test_reports_refuse_a_table_of_other_types_by_its_column(untouched, name, value):
    table = untouched / "summary.parquet"
    pl.read_parquet(table).with_columns(pl.lit(value, pl.String).alias(name)).write_parquet(table)
    with refused_input(table, name):
        _ = CampaignFolder(untouched).runs
