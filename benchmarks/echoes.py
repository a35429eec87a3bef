"""Processes that do nothing but answer: `python -m benchmarks.echoes ENDPOINT BYTES NAME …`, one forked for each name.

They are clients of the same sessions as runners, read with zenoh's own handler, and answer each frame with so many
bytes. They end with their standard input, as the agent host's runners do.
"""

# zenoh's stubs leave out the return type of put.
# pyright: reportUnknownMemberType=false

import os
import signal
import sys

import zenoh

from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import open_runner

RUN = "floor"


def main() -> None:
    """Fork the echoes, and end them when standard input ends."""
    endpoint, size, *names = sys.argv[1:]
    children = [child for name in names if (child := _forked(endpoint, bytes(int(size)), name))]
    sys.stdin.read()
    for child in children:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _forked(endpoint: str, answer: bytes, name: str) -> int:
    child = os.fork()
    if child == 0:
        _echo(endpoint, answer, name)
    return child


def _echo(endpoint: str, answer: bytes, name: str) -> None:
    session, keys = open_runner(endpoint), Keys(RUN)
    frames = session.declare_subscriber(keys.frame(name))
    answers = session.declare_publisher(
        keys.answer(name), congestion_control=zenoh.CongestionControl.BLOCK, express=True
    )
    token = session.liveliness().declare_token(keys.alive(name))
    while True:
        frames.recv()
        answers.put(answer)
    del token


if __name__ == "__main__":
    main()
