"""An agent host of runners that know swarmwire by its protocol alone: `python -m benchmarks.plain_agent_host`.

Arguments and the end are those of swarmwire's own agent host, so that it can stand in its place.
"""

import argparse
import gc
import os
import sys

from examples.protocol.runner import opened, play
from swarmwire.comms.wire.sessions import SMALL_RUNTIME


def main() -> None:
    """`endpoint run_id agents runner runner …`: fork the runners and wait for them all."""
    endpoint, run_id, _, *names = sys.argv[1:]
    os.environ.setdefault("ZENOH_RUNTIME", SMALL_RUNTIME)
    gc.freeze()
    children = [child for name in names if (child := _forked(endpoint, run_id, name))]
    for child in children:
        os.waitpid(child, 0)


def _forked(endpoint: str, run_id: str, name: str) -> int:
    child = os.fork()
    if child == 0:
        session = opened(argparse.Namespace(endpoint=endpoint, ca=None, certificate=None, key=None))
        session.liveliness().declare_subscriber(f"swarmwire/{run_id}/world", history=True).recv()
        play(session, f"swarmwire/{run_id}", name, None)
        os._exit(0)
    return child


if __name__ == "__main__":
    main()
