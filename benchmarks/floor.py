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
    for world_socket in sockets:
        ready.register(world_socket, select.EPOLLIN)
    by_file = {world_socket.fileno(): world_socket for world_socket in sockets}
    frame, clock = bytes(sent_bytes), WallClock()
    for _ in sys.stdin:
        start_ns = clock.now_ns()
        for world_socket in sockets:
            world_socket.send(frame)
        missing = processes
        while missing:
            for file, _ in ready.poll():
                by_file[file].recv(4096)
                missing -= 1
        print(clock.now_ns() - start_ns, flush=True)


def _forked(answer_bytes: int) -> socket.socket:
    world_socket, process_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork() == 0:
        world_socket.close()
        answer = bytes(answer_bytes)
        while process_socket.recv(4096):
            process_socket.send(answer)
        os._exit(0)
    process_socket.close()
    return world_socket


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
