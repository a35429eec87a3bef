"""How the missing runs of a campaign are packed."""

from pathlib import Path
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from swarmwire.deploy.campaign.batches import tasks_of, usual_batch
from swarmwire.deploy.campaign.campaign import Campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.campaign.columns import Columns


class Made(SimpleNamespace):
    """What packing asks of a campaign."""

    point_of, seed_of, runs = Campaign.point_of, Campaign.seed_of, Campaign.runs


def made(points, seeds, robots=10, recorded=(), duration_s=60.0):
    return Made(
        points=[{}] * points,
        seeds=tuple(range(1, seeds + 1)),
        robots=robots,
        duration_s=duration_s,
        point_overrides=[(f"a={point}",) for point in range(points)],
        series=True,
        record_seeds=recorded,
        batch=None,
        columns=lambda: None,
    )


def packed(campaign, done=(), batch=None, workers=2):
    return tasks_of(campaign, CampaignFolder(Path("c"), campaign), done, batch, workers)


@given(st.integers(1, 5), st.integers(1, 130), st.integers(1, 8), st.sets(st.integers(0, 100)))
def test_each_missing_run_is_in_one_task_of_its_point(points, seeds, workers, done):
    campaign = made(points, seeds, recorded=(1,))
    tasks = packed(campaign, done, workers=workers)
    runs = sorted(run for task in tasks for run in task.runs)
    assert runs == [run for run in range(campaign.runs) if run not in done]
    for task in tasks:
        assert {campaign.point_of(run) for run in task.runs} == {task.point}
        assert task.overrides == (f"a={task.point}",)
        assert task.seeds == tuple(run % seeds + 1 for run in task.runs)
        assert (task.record_to is not None) == (task.seeds == (1,) or 1 in task.seeds)
        assert len(task.runs) == 1 or task.record_to is None


def test_packs_are_large_and_smaller_where_workers_would_be_idle_or_pieces_long():
    assert usual_batch(made(9, 200), 2) == 200
    assert usual_batch(made(9, 1000), 2) == 250
    assert usual_batch(made(9, 300), 2) == 150
    assert usual_batch(made(9, 200, duration_s=300.0), 2) == 100
    assert usual_batch(made(9, 200, duration_s=36_000.0), 2) == 50
    assert usual_batch(made(1, 60), 2) == 15
    assert usual_batch(made(1, 3), 8) == 1
    assert usual_batch(made(9, 200, robots=1000), 2) == 5
    assert usual_batch(made(9, 200, robots=100_000), 2) == 1
    assert {len(task.runs) for task in packed(made(2, 30), batch=7)} == {6}


def test_of_a_run_with_several_rows_the_last_counts() -> None:
    columns = Columns({}, [])
    rows = [{"run": 0, "point": 0, "seed": 1, "ended": ended} for ended in ("failed", "duration")]
    assert columns.joined(columns.frame([row]) for row in rows)["ended"].to_list() == ["duration"]
