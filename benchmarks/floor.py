"""The floor of a process for each robot: as many processes that only answer, over socket pairs, with no simulator.

`python -m benchmarks.floor PROCESSES SENT_BYTES ANSWER_BYTES` forks them. For each line of its input it sends every
process one frame, waits for all answers, and prints the nanoseconds that this took.
"""

import gc
import os
import select
import socket
import sys

from swarmwire.comms.base.clock import WallClock


def main(processes: int, sent_bytes: int, answer_bytes: int) -> None:
    """Serve the lines of standard input until it is closed."""
    gc.freeze()  # as the agent host does: the collector would copy shared pages
    sockets = [_forked(answer_bytes) for _ in range(processes)]
    ready = select.epoll()
    for own in sockets:
        ready.register(own, select.EPOLLIN)
    by_file = {own.fileno(): own for own in sockets}
    frame, clock = bytes(sent_bytes), WallClock()
    for _ in sys.stdin:
        start_ns = clock.now_ns()
        for own in sockets:
            own.send(frame)
        missing = processes
        while missing:
            for file, _ in ready.poll():
                by_file[file].recv(4096)
                missing -= 1
        print(clock.now_ns() - start_ns, flush=True)


def _forked(answer_bytes: int) -> socket.socket:
    own, of_process = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork() == 0:
        own.close()
        answer = bytes(answer_bytes)
        while of_process.recv(4096):
            of_process.send(answer)
        os._exit(0)
    of_process.close()
    return own


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
