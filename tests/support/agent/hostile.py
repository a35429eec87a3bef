"""Agents that attack: the socket to their host, other processes, and files of the run. Each robot has one attack.

The file imports nothing of the project but what agents import.
"""

import ctypes
import gc
import json
import os
import signal
import socket
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import msgpack

from swarmwire.agent import Agent, Robot

VICTIM = 0  # row of an honest robot
HEAD = struct.Struct("<6q")
ACTIONS, FAILED = 4, 5
AT_S = 0.45  # begin of the attacks
MARK = "31536017"  # seconds that a program of an agent sleeps, by which it is found


def frames() -> Iterator[FrameType]:
    """The frames on the stack, from the agent's outwards."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        yield frame
        frame = frame.f_back


def own_socket() -> socket.socket:
    """The socket to the host."""
    return next(frame.f_locals["sock"] for frame in frames() if "sock" in frame.f_locals)


def own_row() -> int:
    """The row of this robot."""
    return next(value.row for value in gc.get_objects() if type(value).__name__ == "OneRobotAgent")


def answer(
    tick: int,
    rows: list[int],
    packets: bytes = b"",
    payload: bytes = b"",
    tables: bytes = b"",
    count: int | None = None,
) -> bytes:
    """A frame "actions" in which these robots stand still."""
    count = len(packets) // 32 if count is None else count
    body = struct.pack(f"<{len(rows)}q", *rows) + struct.pack("<4d", 1.0, 0.0, 0.0, 0.0) * len(rows)
    body += packets + payload + tables
    return HEAD.pack(HEAD.size + len(body), ACTIONS, tick, len(rows), count, len(payload)) + body


def packet(sender: int, to: int = -1, status: int = -1, size: int = 4) -> bytes:
    return struct.pack("<4q", sender, to, status, size)


def table(name: str, rows: list[Any], values: list[Any]) -> bytes:
    """The msgpack of a table."""
    return msgpack.packb({name: (rows, values) if name == "notes" else (rows, [0] * len(rows), values)})


ANSWERS: dict[str, Callable[[int, int], list[bytes]]] = {  # attack: messages in place of an answer
    "drives another robot": lambda tick, _row: [answer(tick, [VICTIM])],
    "drives another robot, too": lambda tick, row: [answer(tick, [row, VICTIM])],
    "drives no robot": lambda tick, _row: [answer(tick, [])],
    "sends in another's name": lambda tick, row: [answer(tick, [row], packet(VICTIM), b"fake")],
    "sends of a row that is none": lambda tick, row: [answer(tick, [row], packet(2**62), b"fake")],
    "sends to a negative receiver": lambda tick, row: [answer(tick, [row], packet(row, -7), b"fake")],
    "notes for another": lambda tick, row: [answer(tick, [row], tables=table("notes", [VICTIM], ["forged"]))],
    "values for another": lambda tick, row: [answer(tick, [row], tables=table("values", [VICTIM], [666.0]))],
    "NaN as a value": lambda tick, row: [answer(tick, [row], tables=table("values", [row], [float("nan")]))],
    "a long state": lambda tick, row: [answer(tick, [row], tables=table("notes", [row], ["x" * 10_000]))],
    "an LED of no colour": lambda tick, row: [answer(tick, [row], tables=table("leds", [row], [1e9]))],
    "a table of uneven lengths": lambda tick, row: [answer(tick, [row], tables=table("values", [row], [1.0, 2.0]))],
    "a row of no number": lambda tick, row: [answer(tick, [row], tables=table("values", ["x"], [1.0]))],
    "memory unasked": lambda tick, row: [answer(tick, [row], tables=msgpack.packb({"memory": {"g": {"c": b"x"}}}))],
    "three bytes": lambda _tick, _row: [b"\x00ab"],
    "an empty message": lambda _tick, _row: [b""],
    "bad msgpack": lambda tick, row: [answer(tick, [row], tables=b"\xc1\xc1\xc1")],
    "a list of 2^32 items": lambda tick, row: [answer(tick, [row], tables=b"\x81\xa6values\x93\xdd\xff\xff\xff\xff")],
    "nested 100,000 times": lambda tick, row: [answer(tick, [row], tables=b"\x91" * 50_000)],
    "a length of 2^60": lambda tick, _row: [HEAD.pack(1 << 60, ACTIONS, tick, 1, 0, 0) + bytes((1 << 16) - HEAD.size)],
    "a negative length": lambda tick, _row: [HEAD.pack(-1, ACTIONS, tick, 1, 0, 0)],
    "2^60 packets": lambda tick, row: [answer(tick, [row], count=1 << 60)],
    "-1 packets": lambda tick, row: [answer(tick, [row], count=-1)],
    "negative sizes": lambda tick, row: [answer(tick, [row], packet(row, size=-4) + packet(row, size=8), b"fake")],
    "sizes that overflow": lambda tick, row: [
        answer(tick, [row], packet(row, size=2**62) * 4 + packet(row, size=4), b"fake")
    ],
    "sizes of another sum": lambda tick, row: [answer(tick, [row], packet(row, size=3), b"fake")],
    "another tick": lambda tick, row: [answer(tick + 5, [row])],
    "two answers": lambda tick, row: [answer(tick, [row])] * 2,
    "a flood": lambda tick, row: [answer(tick, [row])] * 300,
    "the failure of another": lambda _tick, _row: [failure("honest-0"), b"\x00ab"],
}


def failure(robots: str) -> bytes:
    data = msgpack.packb({"robots": robots, "traceback": "a lie\n", "reason": "its agent failed: a lie"})
    return HEAD.pack(HEAD.size + len(data), FAILED, -1, 0, 0, 0) + data


def answer_for_ever(messages: Callable[[int, int], list[bytes]], tick: int) -> None:
    """Take this process over: answer each frame with these messages."""
    sock, row = own_socket(), own_row()
    while True:
        for data in messages(tick, row):
            sock.send(data)
        frame = sock.recv(1 << 20)
        if not frame:
            os._exit(0)
        _, _, tick = struct.unpack_from("<3q", frame)


def leave_child() -> None:
    """End, and leave a child with the socket."""
    if os.fork() == 0:
        os.set_inheritable(own_socket().fileno(), True)
        os.setsid()
        os.execvp("sleep", ["sleep", MARK])
    os._exit(3)


def close_socket() -> None:
    """Close the socket, and live on."""
    own_socket().close()
    signal.pause()


ENDS: dict[str, Callable[[], None]] = {"leaves a child": leave_child, "closes its socket": close_socket}


# Attacks on what is around the process: each returns whether it succeeded.


def connects(family: int, address: Any) -> bool:
    with socket.socket(family) as sock:
        sock.settimeout(3.0)
        sock.connect(address)
    return True


def sends_datagram(path: str) -> bool:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        return ours.sendto(b"x", path) == 1


def finds_names(_: Any) -> bool:
    """Find other robots' names or keys in frames and objects of this process."""
    row = own_row()
    values = [value for frame in frames() for value in frame.f_locals.values()]
    groups = [
        value for value in [*values, *gc.get_objects()] if type(value).__name__ in ("GroupAssignment", "Assignment")
    ]
    gc.unfreeze()
    groups += [value for value in gc.get_objects() if type(value).__name__ in ("GroupAssignment", "Assignment")]
    return any((value.rows != row).any() for value in groups)


def relatives() -> list[int]:
    """The fork server, the host, the world, and the processes of other robots."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
    me = int(Path("/proc/self").readlink().name)
    server = parents.get(me, 0)
    siblings = [pid for pid, parent in parents.items() if parent == server and pid != me]
    host = parents.get(server, 0)
    return [pid for pid in (server, host, parents.get(host, 0), *siblings) if pid > 1]


def reads_memory(_: Any) -> bool:
    for pid in relatives():
        try:
            address = int((Path(f"/proc/{pid}/maps").read_text() or "0-").partition("-")[0], 16)
            with Path(f"/proc/{pid}/mem").open("rb") as memory:
                memory.seek(address)
                if memory.read(16):
                    return True
        except OSError:
            continue
    return False


def signals(_: Any) -> bool:
    def may(pid: int) -> bool:
        try:
            os.kill(pid, 0)
        except OSError:
            return False
        return True

    return any(may(pid) for pid in relatives())


def reads_folder(folder: str) -> bool:
    return any(path.is_file() and path.read_bytes() for path in Path(folder).iterdir())


def writes_file(folder: str) -> bool:
    path = Path(folder, f"forged-{os.getpid()}")
    path.write_text("x")
    path.unlink()
    return True


def kills_by_control(targets: Any) -> bool:
    """Kill another robot through the run's control."""
    from swarmwire.deploy.live.remote_control import controlling
    from swarmwire.deploy.runs.live_address import read_live

    live = read_live(Path(targets["run"]))
    assert live is not None
    with controlling(live.endpoint, live.run) as control:
        control.event({"do": "kill", "robots": {"group": "prey"}})
    return True


def connects_to_world(_: Any) -> bool:
    """Connect to the world's socket for agent hosts, whose path is among the host's arguments."""
    words = [word for pid in relatives() for word in Path(f"/proc/{pid}/cmdline").read_text().split("\0")]
    path = next(word for word in words if word.startswith("unixsock-stream/")).partition("/")[2]
    return connects(socket.AF_UNIX, path)


def gains_privileges(_: Any) -> bool:
    no_new_privileges = ctypes.CDLL(None).prctl(39, 0, 0, 0, 0)
    status = Path("/proc/self/status").read_text()
    capabilities = int(next(line for line in status.splitlines() if line.startswith("CapEff")).split()[1], 16)
    return not no_new_privileges or capabilities != 0


OUTSIDE: dict[str, Callable[[Any], bool]] = {
    "network": lambda targets: connects(socket.AF_INET, ("127.0.0.1", targets["port"])),
    "abstract socket": lambda targets: connects(socket.AF_UNIX, f"\0{targets['abstract']}"),
    "unix socket": lambda targets: connects(socket.AF_UNIX, targets["path"]),
    "datagram": lambda targets: sends_datagram(targets["datagrams"]),
    "zenoh's socket": connects_to_world,
    "other robots' keys": finds_names,
    "memory of others": reads_memory,
    "signals to others": signals,
    "privileges": gains_privileges,
    "control": kills_by_control,
    "control file": lambda targets: reads_folder(targets["control"]),
    "run folder": lambda targets: reads_folder(targets["run"]),
    "written file": lambda targets: writes_file(targets["tmp"]),
    "other processes": lambda _: len([targets for targets in Path("/proc").iterdir() if targets.name.isdecimal()]) > 1,
}


class Honest(Agent):
    """Drive at the same speed, always."""

    def step(self, robot: Robot) -> None:
        robot.drive(0.05, 0.0)


class Hostile(Agent):
    """One attack."""

    attack: str
    surroundings: str = "{}"  # places, as JSON

    def step(self, robot: Robot) -> None:
        if robot.time_s < AT_S:
            return
        if self.attack in ANSWERS:
            answer_for_ever(ANSWERS[self.attack], round(robot.time_s * 10))
        if self.attack in ENDS:
            ENDS[self.attack]()
        if robot.time_s > AT_S + 0.1:
            return
        try:
            done = OUTSIDE[self.attack](json.loads(self.surroundings))
        except Exception:  # noqa: BLE001 - however it was refused
            done = False
        robot.note(state=f"{self.attack}: {'done' if done else 'refused'}")
