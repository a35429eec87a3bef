"""A worker process of a campaign: it reads tasks from standard input and writes what came of them to standard output.

It is a program of its own rather than a child of multiprocessing, which would run the user's script again in each.
Standard input is the life line: when it ends, the campaign is gone, and the worker with it, in the middle of a run.
"""

import os
import sys
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread
from typing import BinaryIO

from swarmwire.deploy.campaign.messages import receive, send
from swarmwire.deploy.campaign.run_task import run_task
from swarmwire.deploy.campaign.task import Task, result_message, task_from


def main(arguments: list[str]) -> None:
    """`name`: say that it is ready, then work until standard input ends."""
    (name,) = arguments
    given, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # an agent that asks for input must not take tasks, or wait
    os.dup2(2, 1)  # what agents print is for people
    tasks = SimpleQueue[Task]()
    Thread(target=_listen, args=(given, tasks), daemon=True).start()
    send(results, {"ready": name})

    def alive() -> None:
        with suppress(OSError):  # nobody is there any more: the other thread ends this process
            send(results, {"alive": name})

    while True:
        send(results, result_message(run_task(tasks.get(), name, alive)))


def _listen(given: BinaryIO, tasks: SimpleQueue[Task]) -> None:
    """Take in tasks; end this process, whatever it is at, when nobody is there to give more."""
    while (message := receive(given)) is not None:
        tasks.put(task_from(message))
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
