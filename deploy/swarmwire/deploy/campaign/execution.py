"""Tasks handed to an executor until each has come to rows: lost ones again, then in halves, at last as a failed row."""

from collections import Counter, deque
from collections.abc import Callable, Iterable

from swarmwire.deploy.campaign.executor import Executor, Finished
from swarmwire.deploy.campaign.run_task import lost_task
from swarmwire.deploy.campaign.task import Task, TaskResult

TRIES = 2  # of a task whose worker dies, before it is halved
WAIT_S = 0.1  # at most, until somebody's wish to stop is seen
Keep = Callable[[Task, TaskResult], None]


def execute(tasks: Iterable[Task], executor: Executor, keep: Keep, stopped: Callable[[], bool] = lambda: False) -> bool:
    """Have all tasks done, `keep` each as it is finished, in whatever order; False if `stopped()` before the end.

    What `keep` and the executor raise is passed on. The executor is left open.
    """
    waiting, tries, under_way = deque(tasks), Counter[Task](), 0
    while waiting or under_way:
        if stopped():
            return False
        while waiting and under_way < executor.slots:
            executor.submit(waiting.popleft())
            under_way += 1
        for done in executor.finished(WAIT_S):
            under_way -= 1
            if done.result is not None:
                keep(done.task, done.result)
            else:
                tries[done.task] += 1
                waiting.extendleft(_after_loss(done, tries[done.task], keep))
    return True


def _after_loss(done: Finished, tries: int, keep: Keep) -> list[Task]:
    """What is to be tried next of a task whose worker was lost."""
    if tries < TRIES:
        return [done.task]
    if len(done.task.runs) > 1:
        return list(done.task.halves())
    keep(done.task, lost_task(done.task, done.lost))
    return []
