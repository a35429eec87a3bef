"""What runners do that they should not, each with the count under which the world tells of it.

`beside` are said beside the honest answer, which still counts: they change nothing. `instead` take its place, and do to
the runner's own robots what they say, as a faulty agent would.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack

from examples.protocol.runner import BROADCAST, VERSION, frame, packed, unpacked
from tests.support.runners.raw_runner import Turn

FAR = 2**62
TIMES = 50  # of what comes too often, and yet may all wait (64 may)
REQUEST = {"v": VERSION, "robots": 1, "names": None, "agents": None}
NAN, INF = float("nan"), float("inf")


@dataclass(frozen=True)
class Prank:
    """Something that a runner does in one tick."""

    what: str  # in the words of the docs
    says: Callable[[Turn], Sequence[bytes]]
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    fates: tuple[str, ...] = ()  # of its packets


def first(*wrong: Callable[[Turn], bytes]) -> Callable[[Turn], Sequence[bytes]]:
    """Something wrong, then the honest answer."""
    return lambda turn: [*(of(turn) for of in wrong), turn.honest]


def only(wrong: Callable[[Turn], bytes]) -> Callable[[Turn], Sequence[bytes]]:
    return lambda turn: [wrong(turn)]


def rows_of(turn: Turn) -> list[int]:
    return list(unpacked(turn.arrays["rows"]))


def rows(turn: Turn, change: Callable[[list[int]], list[int]]) -> bytes:
    """The answer for other robots than its own, everything else of it as many."""
    own = change(rows_of(turn))
    return turn.other(rows=packed("<i8", [len(own)], own))


def commands(turn: Turn, *command: float) -> bytes:
    """The answer with one command for all robots: whether, forward, turn, sideways."""
    count = len(rows_of(turn))
    return turn.other(command=packed("<f8", [4, count], [value for value in command for _ in range(count)]))


def packets(turn: Turn, count: int, size: int, to: int = BROADCAST) -> bytes:
    """The answer with so many packets of its first robot."""
    senders = [rows_of(turn)[0]] * count
    return turn.other(
        sent=packed("<i8", [2, count], [*senders, *[to] * count]),
        sent__data=["|u1", [count * size], bytes(count * size)],
        sent__offset=packed("<i8", [count + 1], range(0, count * size + 1, size)),
    )


def falling(turn: Turn) -> bytes:
    """The answer with packets whose bytes begin behind their end."""
    *offsets, last = unpacked(turn.arrays["sent/offset"])
    return turn.other(sent__offset=packed("<i8", [len(offsets) + 1], [last, *offsets]))


def elsewhere(turn: Turn) -> Sequence[bytes]:
    """Says something in the name of a runner that there is not."""
    turn.runner.put(turn.runner.keys.answer("nobody"), turn.honest)
    return [turn.honest]


def joins(*requests: tuple[str, Any]) -> Callable[[Turn], Sequence[bytes]]:
    def says(turn: Turn) -> Sequence[bytes]:
        return [*(_asked(turn, name or turn.runner.name, what) for name, what in requests), turn.honest][-1:]

    return says


def _asked(turn: Turn, name: str, request: Any) -> bytes:
    turn.runner.ask(name, request if isinstance(request, bytes) else msgpack.packb(request))
    return b""


def _none(own: list[int]) -> list[int]:
    return own[:0]


def _beyond(own: list[int]) -> list[int]:
    return [*own[:-1], FAR]


def _reverse(own: list[int]) -> list[int]:
    return own[::-1]


def stolen(turn: Turn) -> bytes:
    """The answer with packets in the name of another's robot."""
    senders, to = rows_of(turn), [BROADCAST] * len(rows_of(turn))
    return turn.other(sent=packed("<i8", [2, len(to)], [*senders[:-1], 0, *to]))


def told(turn: Turn, value: float) -> bytes:
    """The answer with a number of its first robot for whoever looks on."""
    return frame("actions", turn.tick, turn.arrays | _table("values", turn, 0, value), {})


def noted(turn: Turn, states: list[Any]) -> bytes:
    """The answer with a state of its first robot."""
    return frame("actions", turn.tick, turn.arrays | _table("notes", turn, 0, 0.0), {"states": states})


def lit(turn: Turn, which: int, rgb: int) -> bytes:
    """The answer with a light of its first robot."""
    return frame("actions", turn.tick, turn.arrays | _table("leds", turn, which, float(rgb)), {})


def _table(name: str, turn: Turn, place: int, value: float) -> dict[str, Any]:
    """A number of the first robot as the arrays of a sparse table."""
    return {name: packed("<i8", [2, 1], [rows_of(turn)[0], place]), f"{name}/value": packed("<f8", [1], [value])}


BESIDE = (
    Prank("an answer to the last tick", first(lambda turn: turn.other(turn.tick - 1)), {"wrong_tick_frames": 1}),
    Prank("an answer to the next tick", first(lambda turn: turn.other(turn.tick + 1)), {"wrong_tick_frames": 1}),
    Prank(
        "an answer to a tick far away, or before the first",
        first(lambda turn: turn.other(FAR), lambda turn: turn.other(-2)),
        {"wrong_tick_frames": 2},
    ),
    Prank("the answer twice", lambda turn: [turn.honest, turn.honest], {"wrong_tick_frames": 1}),
    Prank("its answer 50 times more", lambda turn: [turn.honest] * (1 + TIMES), {"wrong_tick_frames": TIMES}),
    Prank(
        "all answers of earlier ticks again",
        lambda turn: [*turn.runner.frames[:5], turn.honest],
        {"wrong_tick_frames": 5},
    ),
    Prank(
        "other robots' rows, and none",
        first(lambda turn: rows(turn, lambda own: [row - len(own) for row in own]), lambda turn: rows(turn, _none)),
        {"malformed_frames": 2},
    ),
    Prank(
        "rows that no robot has",
        first(lambda turn: rows(turn, _beyond), lambda turn: rows(turn, lambda own: [-1, *own[1:]])),
        {"malformed_frames": 2},
    ),
    Prank(
        "a robot twice, one too few, or in another order",
        first(
            lambda turn: rows(turn, lambda own: [own[0], *own[:-1]]),
            lambda turn: rows(turn, lambda own: own[:-1]),
            lambda turn: rows(turn, _reverse),
        ),
        {"malformed_frames": 3},
    ),
    Prank("packets of another's robot", first(stolen), {"malformed_frames": 1}),
    Prank(
        "packets whose bytes begin behind their end, or to a robot below -1",
        first(falling, lambda turn: packets(turn, 1, 6, to=-2)),
        {"malformed_frames": 2},
    ),
    Prank(
        "numbers for onlookers that are none",
        first(lambda turn: told(turn, NAN), lambda turn: told(turn, INF)),
        {"malformed_frames": 2},
    ),
    Prank(
        "states that are no texts, too long, or too many",
        first(*(lambda turn, states=states: noted(turn, states) for states in ([7], ["x" * 65], ["x"] * 257, []))),
        {"malformed_frames": 4},
    ),
    Prank(
        "colours of a light that there are not",
        first(lambda turn: lit(turn, 0, 2**24), lambda turn: lit(turn, -1, 0)),
        {"malformed_frames": 2},
    ),
    Prank(
        "half of its answer, nothing, or noise",
        first(lambda turn: turn.honest[: len(turn.honest) // 2], lambda _: b"", lambda _: b"\xc1" * 40),
        {"malformed_frames": 3},
    ),
    Prank(
        "a frame of another version",
        first(lambda turn: turn.honest.replace(b"\xa1v\x01", b"\xa1v\x02", 1)),
        {"malformed_frames": 1},
    ),
    Prank(
        "arrays with fewer bytes, or another type, than they say",
        first(
            lambda turn: turn.other(command=["<f8", [4, 2**40], b""]),
            lambda turn: turn.other(rows=["<f8", [1], bytes(8)]),
        ),
        {"malformed_frames": 2},
    ),
    Prank(
        "frames of kinds that runners do not send, and `ready` again",
        first(
            *(
                lambda turn, kind=kind: frame(kind, turn.tick, {}, {})
                for kind in ("tick", "end", "dance", "sent", "ready")
            )
        ),
        {"unexpected_kind_frames": 5},
    ),
    Prank("answers under a name that nobody has", elsewhere, {"unknown_runner_frames": 1}),
    Prank("joins again and again while it plays", joins(*[("", REQUEST)] * 20), {"refused_join": 20}),
    Prank(
        "joins under other names where no robot is free",
        joins(("other", REQUEST), ("third", REQUEST)),
        {"refused_join": 2},
    ),
    Prank("requests to join that are none", joins(("fourth", b"\xc1"), ("fifth", {"v": 9})), {"bad_join": 2}),
)
"""What is dropped and counted; the honest answer, which comes too, counts."""

EARLY = Prank(
    "answers before it is ready",
    lambda _: [frame("actions", tick, {}, {}) for tick in (-1, 0)],
    {"wrong_tick_frames": 2},
)
INSTEAD = (
    Prank(
        "commands that are nan, or infinite", only(lambda turn: commands(turn, 1.0, NAN, INF, 0.0)), {"nan_commands": 3}
    ),
    Prank(
        "commands far beyond what the body can do",
        only(lambda turn: commands(turn, 1.0, 1e300, -1e300, 0.0)),
        {"clipped_commands": 3},
    ),
    Prank("packets that are too large for the radio", only(lambda turn: packets(turn, 2, 5000)), fates=("too_large",)),
    Prank(
        "far more packets than the radio's queue takes",
        only(lambda turn: packets(turn, 300, 20)),
        fates=("queue_full",),
    ),
    Prank(
        "packets to robots that there are not", only(lambda turn: packets(turn, 4, 6, to=77)), {"packets_to_nobody": 4}
    ),
)
"""What counts as the answer of its robots; those of others go on as without it."""
