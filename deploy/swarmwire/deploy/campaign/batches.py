"""The tasks of a campaign: the runs that are missing, in batches of seeds of one design point."""

from collections.abc import Collection, Iterator, Sequence

from swarmwire.deploy.campaign.campaign import Campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.campaign.task import Task

USUAL_PACK = 250  # arenas in a world: of ten robots each, 125 cost a tenth more per run, 50 half as much again
LONG_BATCH = 50  # of runs so long that a task, lost as a whole where a campaign is killed, would be much work
BATCH_S = 30_000  # simulated, over all arenas: beyond, a batch has fewer than the usual, down to that of long runs
MAX_ROBOTS = 5_000  # in a world of several arenas: from there on packing gains nothing, and memory is dear
ROUNDS = 2  # tasks for each worker at least, so that none is idle for long at the end


def tasks_of(
    campaign: Campaign, folder: CampaignFolder, done: Collection[int], batch: int | None, workers: int
) -> list[Task]:
    """A task for each batch of runs that are not `done`; those that are recorded in full are on their own."""
    seeds, tasks = len(campaign.seeds), list[Task]()
    size = batch or campaign.batch or usual_batch(campaign, workers)
    for point in range(len(campaign.points)):
        missing = [run for run in range(point * seeds, (point + 1) * seeds) if run not in done]
        recorded = [run for run in missing if campaign.seed_of(run) in campaign.record_seeds]
        together = [run for run in missing if campaign.seed_of(run) not in campaign.record_seeds]
        tasks += [_task(campaign, folder, point, [run], recorded=True) for run in recorded]
        tasks += [_task(campaign, folder, point, runs, recorded=False) for runs in shares(together, size)]
    return tasks


def usual_batch(campaign: Campaign, workers: int) -> int:
    """How many arenas a world has where nobody says."""
    most = max(LONG_BATCH, int(BATCH_S / campaign.duration_s))
    return batch_for(len(campaign.points), len(campaign.seeds), campaign.robots, workers, most)


def batch_for(points: int, seeds: int, robots: int, workers: int, most: int = LONG_BATCH) -> int:
    """The same, of so many points with so many seeds each, at most so many robots in an arena, and `most` arenas."""
    most = max(1, min(USUAL_PACK, most, MAX_ROBOTS // robots))
    batches = max(-(-seeds // most), -(-ROUNDS * workers // points))  # of each point
    return max(1, -(-seeds // batches))


def shares(runs: Sequence[int], size: int) -> Iterator[Sequence[int]]:
    """Shares of at most this size, which differ by one run at most."""
    count = -(-len(runs) // size)
    for share in range(count):
        yield runs[len(runs) * share // count : len(runs) * (share + 1) // count]


def _task(campaign: Campaign, folder: CampaignFolder, point: int, runs: Sequence[int], *, recorded: bool) -> Task:
    return Task(
        scenario=str(folder.scenario),
        overrides=campaign.point_overrides[point],
        point=point,
        runs=tuple(runs),
        seeds=tuple(campaign.seed_of(run) for run in runs),
        series=campaign.series,
        record_to=str(folder.run_folder(runs[0])) if recorded else None,
    )
