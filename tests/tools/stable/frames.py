"""What goes over the wire: keys, the exchange by which a runner joins, and the arrays and values of every frame."""

from typing import Any

import msgpack
import numpy as np

from swarmwire.comms.observe.run_views import ObservedRun, ObservedTick
from swarmwire.comms.observe.truth import EventRecord, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.messages import Message, f4, f8, i1, u2
from swarmwire.comms.robot.packets import Fate, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, SparseTable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment
from swarmwire.comms.wire.join import GroupInfo, JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.observer_frames import OBSERVED_VERSION, encode_scene, encode_truth
from swarmwire.comms.wire.tick_frames import encode_actions, encode_packets, encode_sent, encode_tick
from tests.tools.stable.samples import LEFT_OUT, joined, lines_of, paths_of, sample

# Lengths of axes, each its own, so that a shape can be told in words.
ARENAS, ROBOTS, TOLD_OF, RECEIVED, SENT, STATUSES, MEASURES, BYTES, WIDE = 11, 13, 17, 19, 23, 29, 31, 37, 41
SERIES, EDGES, LINKS, LEDS, MOVABLE, NOTED, SWITCHED, ACTUATED, REPORTED = 43, 47, 53, 59, 61, 67, 71, 73, 79
AXES = {
    ARENAS: "arenas",
    ARENAS * ROBOTS: "robots",
    TOLD_OF: "robots in the frame",
    RECEIVED: "received",
    SENT: "sent",
    SENT + 1: "sent + 1",
    STATUSES: "statuses",
    MEASURES: "measures",
    BYTES: "bytes",
    WIDE: "numbers of the sense",
    SERIES: "series",
    EDGES: "edges",
    LINKS: "links",
    LEDS: "LEDs",
    3 * MOVABLE: "3 x movable",
    NOTED: "noted",
    SWITCHED: "switched",
    ACTUATED: "actuated",
    REPORTED: "told",
    len(Fate): "fates",
}


class Told(Message):
    """A message as it goes on air."""

    x_m: f4
    count: u2
    place: f8
    turns: i1


def text() -> str:
    """The keys, the exchange, and each frame, a line for each thing in it."""
    parts = {
        "keys of runners": _keys(Keys("RUN"), "RUNNER"),
        "keys of observers": _keys(ObserverKeys("RUN")),
        "every frame": lines_of(paths_of({"v": 1, "kind": "", "tick": 1, "arrays": {}, "values": {}})),
        "join, asked": _map(JoinRequest(1, None, {"*": "a"}, "a").encode(), JoinRequest(None, ("a",)).encode()),
        "join, answered": lines_of(paths_of({**_assignment().as_mapping(), "v": frames.VERSION, "memory": b""})),
        "offer, answered": _map(_offer(1.0).encode(), _offer(None).encode()),
        "tick": _frame(encode_tick(1, _readings(), _received(), TxStatuses(*_ints(3, STATUSES)))),
        "actions": _frame(encode_actions(1, _actions(), dropped=1, memory=_memory())),
        "packets": _frame(encode_packets(1, 1, 1, _received(), TxStatuses(*_ints(3, STATUSES)))),
        "sent": _frame(encode_sent(1, _actions().sent, missed=1)),
        f"scene, version {OBSERVED_VERSION}": _frame(*(encode_scene(sample(ObservedRun, level)) for level in LEFT_OUT)),
        "message, on air": f"{Told(x_m=1.5, count=3, place=-2.25, turns=-1).encode().hex(' ')}\n",
        f"truth, version {OBSERVED_VERSION}": _frame(encode_truth(_glimpse())),
    }
    return f"# version {frames.VERSION}\n" + "".join(f"# {title}\n{lines}" for title, lines in parts.items())


def _keys(keys: object, *arguments: str) -> str:
    plain = {name: key for name, key in vars(keys).items() if name != "root"}
    called = {name: getattr(keys, name)(*arguments) for name in vars(type(keys)) if not name.startswith("_")}
    return "".join(f"{name}: {key}\n" for name, key in {**plain, **called}.items())


def _map(*several: bytes) -> str:
    return lines_of(joined(*(paths_of(msgpack.unpackb(data)) for data in several)))


def _frame(*several: bytes) -> str:
    frame = frames.decode(several[0])
    arrays = [f"{name}: {array.dtype.str} {_shape(array.shape)}\n" for name, array in frame.arrays.items()]
    return "".join(sorted(arrays)) + lines_of(joined(*(paths_of(frames.decode(data).values) for data in several)))


def _shape(shape: tuple[int, ...]) -> str:
    return f"({', '.join(AXES.get(length, str(length)) for length in shape)})"


def _ints(*shape: int) -> Any:
    return np.zeros(shape, np.int64)


def _floats(*shape: int) -> Any:
    return np.zeros(shape)


def _readings() -> dict[str, GroupReadings]:
    return {"GROUP": GroupReadings(_ints(TOLD_OF), {"SENSE.FIELD": _floats(TOLD_OF, WIDE)})}


def _received() -> ReceivedPackets:
    measured = {f"given {i}": _floats(RECEIVED) for i in range(MEASURES)}
    return ReceivedPackets(
        *_ints(4, RECEIVED), measured, _ints(RECEIVED), Payloads(np.zeros(BYTES, np.uint8), _ints(SENT + 1))
    )


def _actions() -> Actions:
    payloads = Payloads(np.zeros(BYTES, np.uint8), _ints(SENT + 1))
    return Actions(
        _ints(TOLD_OF),
        np.ones(TOLD_OF, np.bool_),
        *_floats(3, TOLD_OF),
        SentPackets(*_ints(2, SENT), payloads, _ints(SENT)),
        SparseTable(*_ints(2, NOTED), _floats(NOTED), ("",)),
        *(SparseTable(*_ints(2, k), _floats(k)) for k in (SWITCHED, ACTUATED, REPORTED, SWITCHED)),
    )


def _assignment() -> Assignment:
    keys = np.zeros(1, np.uint64)
    group = GroupAssignment("g", "a", {"*": 0.5}, load_body("epuck"), _ints(1), ("g-0",), keys)
    return Assignment((group,), 1, ("range_m",))


def _memory() -> GroupMemories:
    return {"GROUP": GroupMemory(_ints(TOLD_OF), {"COLUMN": _floats(TOLD_OF, WIDE)})}


def _offer(real_time: float | None) -> SessionInfo:
    return SessionInfo("RUN", "s", "a", "1", 1, real_time, (GroupInfo("g", "a", "a", 1, ("g-0",)),))


def _glimpse() -> ObservedTick:
    rows = ARENAS * ROBOTS
    flags = np.ones(rows, np.bool_)
    truth = Truth(
        tick=1,
        time_ns=1,
        running=np.ones(ARENAS, np.bool_),
        alive=flags,
        pose=_floats(rows, 3),
        velocity=_floats(rows, 3),
        command=_floats(rows, 3),
        state=_ints(rows),
        states=("",),
        leds=_ints(rows, LEDS),
        readings=_readings(),
        contact_onsets=_ints(ARENAS, 2),
        edges=_ints(EDGES, 2),
        tally=PacketCounts(*_ints(3, ARENAS), _ints(ARENAS, len(Fate))),
        finished=ReceptionRecords(*_ints(12, LINKS), rssi_dbm=_floats(LINKS)),
        events=(EventRecord(1, 0.5, "", True, flags),),
        movable=_floats(ARENAS, MOVABLE, 3),
    )
    return ObservedTick(truth, 1, 1, _floats(SERIES, ARENAS))
