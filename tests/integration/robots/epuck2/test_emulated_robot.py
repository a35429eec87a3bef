import socket
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.protocols.epuck2.packets import PAYLOAD_BYTES, RobotCommand
from swarmwire.world.gateways.epuck2.emulated_robot import EmulatedRobot, UnreadBytes
from tests.support.robots.epuck2 import command


class Task:
    """A robot whose passes the test does, and its clients."""

    def __init__(self, stack: ExitStack) -> None:
        self.commands: list[RobotCommand] = []
        self.counts = Counter[str]()
        self.robot = EmulatedRobot(self.commands.append, lambda header: bytes(PAYLOAD_BYTES[header]), self.counts)
        self._unread, self._stack = stack.enter_context(closing(UnreadBytes())), stack
        stack.callback(self.robot.hang_up)

    def client(self, *, small: bool = False) -> socket.socket:
        """A connected client; the buffers between a small one and the robot do not hold an image."""
        client = self._stack.enter_context(socket.socket())
        with socket.create_server(("127.0.0.1", 0)) as server:
            if small:
                client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                server.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
            client.connect(server.getsockname())
            self.robot.connect(server.accept()[0])
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setblocking(False)
        return client

    def do(self, passes: int) -> None:
        for _ in range(passes):
            self.robot.do_pass(self._unread)

    def lefts(self) -> list[int]:
        return [command.left for command in self.commands]


@pytest.fixture
def task() -> Iterator[Task]:
    with ExitStack() as stack:
        yield Task(stack)


def read(client: socket.socket) -> bytes:
    """All that has come."""
    data = b""
    try:
        while more := client.recv(65536):
            data += more
    except BlockingIOError:
        pass
    return data


def test_robot_sends_nothing_before_the_first_command(task: Task) -> None:
    client = task.client()
    task.do(10)
    assert read(client) == b""


def test_robot_reads_in_one_pass_and_sends_each_part_in_another(task: Task) -> None:
    client = task.client()
    client.sendall(command(request=3))
    sizes: list[int] = []
    for _ in range(6):
        task.do(1)
        sizes.append(len(read(client)))
    assert sizes == [0, 38401, 105, 0, 38401, 105]
    assert len(task.commands) == 1


@pytest.mark.parametrize(("waiting", "read_ones"), [(4, [0, 1, 2, 3]), (5, [4]), (9, [8])])
def test_robot_reads_only_the_last_of_five_commands(task: Task, waiting: int, read_ones: list[int]) -> None:
    client = task.client()
    client.sendall(b"".join(command(left=i) for i in range(waiting)))
    for _ in range(20):
        task.do(1)
        read(client)
    assert task.lefts() == read_ones
    assert task.counts["commands_flushed"] == waiting - len(read_ones)


def test_robot_reads_the_command_that_has_begun_to_arrive(task: Task) -> None:
    client, last = task.client(), command(left=6)
    client.sendall(b"".join(command(left=i) for i in range(6)) + last[:9])
    task.do(4)
    assert task.lefts() == []
    client.sendall(last[9:])
    task.do(1)
    assert task.lefts() == [6]


@given(cuts=st.lists(st.integers(0, 84)))
def test_robot_reads_commands_in_any_fragments(cuts: list[int]) -> None:
    with ExitStack() as stack:
        task = Task(stack)
        client, sent = task.client(), b"".join(command(left=i) for i in range(4))
        for start, end in zip(sorted([0, *cuts]), sorted([*cuts, len(sent)]), strict=True):
            client.sendall(sent[start:end])
            task.do(3)
            read(client)
        task.do(20)
        assert task.lefts() == [0, 1, 2, 3]
        assert not task.counts


@pytest.mark.parametrize(("commands", "request_", "size", "passes"), [(30, {}, 105, 2), (3, {"request": 3}, 38401, 1)])
def test_answers_wait_for_a_slow_client_and_commands_do_not(task, commands, request_, size, passes) -> None:
    client = task.client()
    for i in range(commands):
        client.sendall(command(left=i, **request_))
        task.do(2)
    assert task.lefts() == list(range(commands))
    assert len(read(client)) == size  # an image is complete before the sensors are read
    task.do(passes)
    assert len(read(client)) == 105


def test_client_that_reads_nothing_blocks_the_robot(task: Task) -> None:
    client = task.client(small=True)
    client.sendall(command(left=1, request=1))
    task.do(5)
    client.sendall(command(left=2, request=1))
    task.do(5)
    assert task.lefts() == [1]
    image = b""
    while len(image) < 38401:
        image += read(client)
        task.do(1)
    task.do(1)
    assert task.lefts() == [1, 2]


def test_lost_client_leaves_its_command_and_the_next_is_served(task: Task) -> None:
    first, second = task.client(), task.client()
    first.sendall(command(left=1) + command(left=7)[:20])
    second.sendall(command(left=2))
    task.do(5)
    assert task.lefts() == [1]
    first.close()
    task.do(10)
    assert task.lefts() == [1, 2]
    assert task.counts == {"half_commands": 1}
    assert read(second)[:1] == b"\x02"
