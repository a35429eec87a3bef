"""What the page about the protocol tells is what the code does: keys, fields, arrays, kinds, limits, counts."""

import inspect
import re
from dataclasses import fields, replace

import msgpack
import numpy as np

from swarmwire.agent import runner
from swarmwire.agent.behaviours.flocking import Heading
from swarmwire.comms.actuations import Actuations
from swarmwire.comms.led_changes import LedChanges
from swarmwire.comms.notes import Notes
from swarmwire.comms.outcomes import Outcomes, SendResult
from swarmwire.comms.packets import BROADCAST, Heard, Payloads, Sent
from swarmwire.comms.senses import Actions, GroupSenses
from swarmwire.comms.values import Values
from swarmwire.comms.wire import frames, join_request, tick_frames, unpacking
from swarmwire.comms.wire.join_request import JoinRequest
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.limits import LIMITS
from swarmwire.comms.wire.offer import Offer, OfferedGroup
from swarmwire.comms.wire.tick_frames import encode_actions, encode_tick
from swarmwire.world.crews import admission, lockstep, realtime, roster, runner_crew, runner_inbox
from tests.docs.pages import ROOT
from tests.support.agent.hosts import assignment, group

PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
ROWS = np.array([4, 6])


def table(name: str) -> dict[str, list[str]]:
    """The other cells of each row of a table, by the first."""
    found = re.search(rf"<!-- table: {name} -->\n((?:\|.*\n)+)", PAGE)
    assert found, name
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in found[1].splitlines()[2:]]
    return {row[0].strip("`").replace("\\|", "|"): [cell.replace("\\|", "|") for cell in row[1:]] for row in rows}


def names(of: type) -> set[str]:
    return {field.name for field in fields(of)}


def described(data: bytes) -> dict[str, tuple[str, int]]:
    """Dtype and number of axes of each array of a frame."""
    return {name: (array.dtype.str, array.ndim) for name, array in frames.decode(data).arrays.items()}


def told(name: str) -> dict[str, tuple[str, int]]:
    """The same, as a table of the page tells."""
    return {array: (dtype.strip("`"), _axes(shape)) for array, (dtype, shape, _) in table(name).items()}


def _axes(shape: str) -> int:
    return len([length for length in shape.split(")", maxsplit=1)[0].strip("(").split(",") if length])


def test_versions_and_keys() -> None:
    assert set(re.findall(r'"v": (\d)', PAGE)) == {str(frames.VERSION)}
    assert {table(name)["v"][1] for name in ("offer", "join request", "assignment", "frame")} == {str(frames.VERSION)}
    keys = Keys("RUN")
    named = [getattr(keys, of)("NAME") for of in ("offer", "join", "alive", "frame", "answer")]
    assert {f"`{key}`" for key in [keys.world, *named]} <= set(PAGE.split())


def test_maps_of_joining() -> None:
    assert table("offer").keys() == names(Offer) | {"v"}
    assert table("offered group").keys() == names(OfferedGroup)
    assert table("join request").keys() == names(JoinRequest) | {"v"}
    assigned = assignment(group("unused:Agent", [0, 1])).as_mapping()
    assert table("assignment").keys() == assigned.keys() | {"v", "memory"}
    assert table("assigned group").keys() == assigned["groups"][0].keys()


def test_frames_and_their_arrays() -> None:
    assert table("frame").keys() == frames.KEYS == msgpack.unpackb(frames.encode("end", -1, {})).keys()
    assert {code: int(size) for code, (_, size) in table("dtypes").items()} == {
        code: dtype.itemsize for code, dtype in frames.DTYPES.items()
    }
    one = np.zeros(1, np.int64)
    heard = Heard(one, one, one, one, {"range_m": np.zeros(1)}, one, Payloads.of([b"abc"]))
    senses = {"GROUP": GroupSenses(ROWS, {"SENSE.FIELD": np.zeros(2)})}
    assert described(encode_tick(0, senses, heard, Outcomes(one, one, one))) == told("tick")
    zeros = np.zeros(2)
    sent = Sent(ROWS, np.array([BROADCAST, 1]), Payloads.of([b"a", b"b"]), np.array([-1, 0]))
    actions = replace(
        Actions(ROWS, zeros == 0, zeros, zeros, zeros, sent, Notes(ROWS, np.array([0, 0]), ("x",))),
        leds=LedChanges(ROWS, ROWS, ROWS),
        own=Actuations(ROWS, ROWS, zeros),
        values=Values(ROWS, zeros),
    )
    assert described(encode_actions(0, actions)) == told("actions")


def test_kinds_and_results() -> None:
    sources = "".join(inspect.getsource(module) for module in (runner, tick_frames, runner_crew))
    assert set(re.findall(r'frames\.encode\("(\w+)"', sources)) <= table("kinds").keys()
    assert [int(number) for number in table("results")] == [result.value for result in SendResult]


def test_the_tag_of_a_message() -> None:
    found = re.search(r"<!-- tag: Heading -->(\d+)", PAGE)
    assert found
    assert int(found[1]) == Heading.tag


def test_limits() -> None:
    told = {name: float(value.split()[0]) for name, (value, _) in table("limits").items()}
    ours = {field.name: float(getattr(LIMITS, field.name)) for field in fields(LIMITS)}
    ours |= {"frame": frames.MOST_BYTES, "items": unpacking.MOST_ITEMS, "request to join": join_request.MOST_BYTES}
    assert told == ours


def test_what_is_counted() -> None:
    sources = "".join(
        inspect.getsource(module)
        for module in (unpacking, frames, tick_frames, admission, roster, lockstep, realtime, runner_inbox)
    )
    faults = {f"{fault}_frames" for fault in re.findall(r'BadFrame\("(\w+)"', sources)}
    named = set(re.findall(r'"((?:bad|refused)_join|flooded_frames)"', sources))
    assert table("counted").keys() == faults | named
