"""What a sweep writes, statistics read: a campaign's folder by its writer, seen through its reader."""

from contextlib import suppress

import polars as pl
import pytest

from swarmwire.deploy.campaigns.columns import failure_line
from swarmwire.deploy.campaigns.folder import new_folder
from swarmwire.deploy.campaigns.store import CampaignWriter, StorageFailed
from swarmwire.deploy.campaigns.worker import TaskResult
from swarmwire.metrics.records.campaign.campaign_json import Campaign, Response, write_campaign
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.run_folder.layout import CopiedFile
from tests.support.refusals import refused_input

CAMPAIGN = Campaign(
    name="loss",
    scenario="flock",
    command="swarmwire sweep flock.toml",
    began_utc="20240501T120000Z",
    versions={"python": "3.11"},
    cpu="made-up CPU",
    modules={"swarmwire.world": "0" * 64},
    files=(CopiedFile("scenario.toml", "0" * 64, "scenario"),),
    design="list",
    seeds=(4, 2),
    vary={"radio.loss": [0, 0.5], "physics.engine": ["discs", "pymunk"]},
    points=({"radio.loss": 0, "physics.engine": "discs"}, {"radio.loss": 0.5, "physics.engine": "pymunk"}),
    overrides=("duration_s=20",),
    point_overrides=((), ()),
    duration_s=20,
    robots=3,
    responses=(Response("order.final", "", "number", "order"), Response("found_s", "s", "time", "first find")),
    series=True,
    record_seeds=(),
    batch=None,
    realtime=None,
    max_late=0.01,
)


def row(run, **values):
    ends = {"ended": "duration", "ticks": 200, "sim_time_s": 20.0}
    return {"run": run, "point": run // 2, "seed": CAMPAIGN.seeds[run % 2], **ends, **values}


@pytest.fixture
def written(tmp_path):
    """Two tasks of a campaign: a run that found nothing, one that failed, one that faulted; the last is missing."""
    write_campaign(CAMPAIGN, tmp_path)
    folder = CampaignWriter(tmp_path, CAMPAIGN)
    last = row(1, **{"order.final": 0.9, "found_s": 7.5})
    folder.write(TaskResult((row(0, **{"order.final": 0.5, "counts.late_answers": 3}), last)))
    folder.write(TaskResult((row(2, ended="failed", error="the agent failed"),)))
    return folder


def test_unfinished_campaign_is_read_back(written):
    read = CampaignFolder(written.path)
    assert (read.about.name, read.about.seeds, read.about.design) == ("loss", (4, 2), "list")
    assert read.points == CAMPAIGN.points
    assert read.parameters == ("radio.loss", "physics.engine")
    assert (read.finished, read.missing) == (False, (3,))
    assert read.sample("order", 0).value.tolist() == [0.5, 0.9]
    times = read.sample("found_s", 0)
    assert (times.value.tolist(), times.observed.tolist()) == ([20.0, 7.5], [False, True])
    assert read.sample("found_s", 1).failed == 1


def test_finished_campaign_is_read_back(written):
    written.write(TaskResult((row(3, **{"order.final": None, "found_s": None}),)))
    written.finish(files=1)
    read = CampaignFolder(written.path)
    assert read.finished
    assert read.runs["run"].to_list() == [0, 1, 2, 3]
    undefined = read.sample("order.final", 1)
    assert (len(undefined), undefined.undefined, undefined.failed) == (0, 1, 1)


def test_retried_run_is_read_with_its_last_result(written):
    assert CampaignFolder(written.path).sample("order", 1).failed == 1
    written.write(TaskResult((row(2, **{"order.final": 0.7}),)))
    again = CampaignFolder(written.path).sample("order", 1)
    assert (again.value.tolist(), again.failed) == ([0.7], 0)


@pytest.mark.parametrize("damage", [pl.exceptions.ComputeError("cut off"), pl.exceptions.PanicException("cut off")])
def test_damaged_series_fails_in_one_line_while_it_is_joined(written, monkeypatch, damage):
    frame = pl.DataFrame({"run": [3], "tick": [0], "order": [0.5]})
    (written.path / "series").mkdir()
    frame.write_parquet(written.path / "series" / "part-00000003.parquet")

    def damaged(*_, **__):
        raise damage

    monkeypatch.setattr(pl.LazyFrame, "sink_parquet", damaged)
    with pytest.raises(StorageFailed, match="--resume") as failed:
        written.finish(1)
    assert "\n" not in str(failed.value)


@pytest.mark.parametrize("name", ["parts", "series", "runs"])
def test_linked_folder_in_a_resumed_campaign_is_refused(written, tmp_path_factory, name):
    mine = tmp_path_factory.mktemp("mine")
    (mine / ".aside-mine").write_text("mine")
    if (written.path / name).exists():
        (written.path / name).rename(written.path / f"former-{name}")
    (written.path / name).symlink_to(mine)
    with pytest.raises(StorageFailed):
        written.clear()
    assert [file.name for file in mine.iterdir()] == [".aside-mine"]


def test_row_of_a_campaign_replaces_a_link_and_leaves_its_target(written):
    mine = written.path / "mine"
    mine.write_text("mine")
    (written.path / "parts" / ".aside-part-00000002.parquet").symlink_to(mine)
    written.write(TaskResult((row(3, **{"order.final": None, "found_s": None}),)))
    assert mine.read_text() == "mine"
    assert written.rows()["run"].to_list() == [0, 1, 2, 3]


CALLED = 'Traceback (most recent call last):\n  File "near.py", line 9, in step\n    robot.go()\n'


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (f"the agent of a-0 failed:\n{CALLED}ValueError: too near\nin tick 5, at 0.5 s\n", "ValueError: too near"),
        (f"the agent of a-0 failed:\n{CALLED}AttributeError: go\nRobot has radio\nin tick 5\n", "AttributeError: go"),
        (f"the metric east failed:\n{CALLED}KeyError: 'x'\n", "KeyError: 'x'"),
        ("robots.flock.place: no room for flock-7 with seed 3", "robots.flock.place: no room for flock-7 with seed 3"),
        ("the worker died\n", "the worker died"),
    ],
)
def test_failure_line_names_the_cause_of_a_failed_run(error, line):
    assert failure_line(error) == line


def test_campaign_folder_is_empty_again_after_an_interrupted_start(tmp_path):
    with suppress(KeyboardInterrupt), new_folder(tmp_path / "out", "campaign") as scenario_folder:
        (scenario_folder / "scenario.toml").touch()
        raise KeyboardInterrupt
    with new_folder(tmp_path / "out", "campaign") as scenario_folder:
        assert not [*scenario_folder.iterdir()]


@pytest.mark.parametrize(("file", "advice"), [("campaign.json", "to continue"), ("scenario", "remove")])
def test_campaign_folder_that_is_not_empty_is_refused_with_its_next_step(file, advice, tmp_path):
    (tmp_path / file).mkdir()
    with refused_input(key=str(tmp_path), match=advice), new_folder(tmp_path, "campaign"):
        pass
