"""A runner that knows swarmwire by docs/protocol.md alone, with Python's own library, zenoh and msgpack.

    python runner.py ENDPOINT [--name NAME] [--run RUN] [--robots N] [--ca FILE --certificate FILE --key FILE]

Its robots flock: each broadcasts its heading, turns to the mean of the headings that it hears, towards who is far and
away from who is near and from what its rays see. They need a compass, proximity, and a radio that tells range and
bearing.
"""

# zenoh's stubs leave out some types.
# pyright: reportUnknownMemberType=false

import argparse
import hashlib
import json
import math
import queue
import struct
import traceback
from collections.abc import Iterable, Sequence
from typing import Any

import msgpack
import zenoh

VERSION, BROADCAST = 1, -1
LETTERS = {"<f8": "d", "<i8": "q", "<u8": "Q", "|b1": "?", "|u1": "B"}  # of Python's struct
HEADING = "Heading(heading_rad:<f4)"  # the message that the robots send, as its tag is made from it
TAG = 1 + int.from_bytes(hashlib.blake2b(HEADING.encode(), digest_size=2).digest(), "little") % 0xFFFF

Neighbour = tuple[float, float, float]  # range, bearing and heading, of a packet that was received


def steer(heading: float, angles: Iterable[float], rays: Iterable[float], received: Sequence[Neighbour]) -> list[float]:
    """Forward speed and turn rate."""
    x = y = 0.0
    for distance, bearing, theirs in received:
        pull = 0.6 * min((distance - 0.4) / 0.4, 1.0)
        x += pull * math.cos(bearing) + math.cos(theirs - heading)
        y += pull * math.sin(bearing) + math.sin(theirs - heading)
    x, y = 0.3 + x / max(len(received), 1), y / max(len(received), 1)
    for angle, value in zip(angles, rays, strict=True):
        x, y = x - 3.0 * value * math.cos(angle), y - 3.0 * value * math.sin(angle)
    angle = math.atan2(y, x)
    return [0.1 * max(math.cos(angle), 0.0), 2.0 * angle]


def unpacked(array: Any) -> tuple[Any, ...]:
    """The numbers of an array, row after row."""
    dtype, shape, data = array
    return struct.unpack(f"<{math.prod(shape)}{LETTERS[dtype]}", data)


def packed(dtype: str, shape: list[int], numbers: Iterable[float]) -> Any:
    return [dtype, shape, struct.pack(f"<{math.prod(shape)}{LETTERS[dtype]}", *numbers)]


def frame(kind: str, tick: int, arrays: dict[str, Any], values: dict[str, Any]) -> bytes:
    return msgpack.packb({"v": VERSION, "kind": kind, "tick": tick, "arrays": arrays, "values": values})


def neighbours(arrays: dict[str, Any], measures: list[str]) -> dict[int, list[Neighbour]]:
    """What each robot row received of headings."""
    received: dict[int, list[Neighbour]] = {}
    if "received/numbers" in arrays:
        count = arrays["received/numbers"][1][1]
        numbers, measured = unpacked(arrays["received/numbers"]), unpacked(arrays["received/given"])
        data, offset = arrays["received/data"][2], unpacked(arrays["received/offset"])
        range_m, bearing_rad = (measured[measures.index(name) * count :] for name in ("range_m", "bearing_rad"))
        for at, payload in enumerate(numbers[4 * count :]):
            message = data[offset[payload] : offset[payload + 1]]
            if len(message) == 6 and int.from_bytes(message[:2], "little") == TAG:
                theirs = range_m[at], bearing_rad[at], *struct.unpack_from("<f", message, 2)
                received.setdefault(numbers[at], []).append(theirs)
    return received


def acted(arrays: dict[str, Any], assignment: dict[str, Any]) -> dict[str, Any]:
    """A command and a packet of each robot that acts in a tick."""
    received = neighbours(arrays, assignment["measures"])
    rows: list[int] = []
    commands: list[list[float]] = []
    messages = b""
    for group in assignment["groups"]:
        prefix = f"readings/{group['name']}"
        if f"{prefix}/rows" in arrays:  # else the group does not act in this tick
            angles = [math.radians(angle) for angle in group["body"]["sensors"]["proximity"]["angles_deg"]]
            headings = unpacked(arrays[f"{prefix}/compass.heading_rad"])
            values = unpacked(arrays[f"{prefix}/proximity.value"])
            for at, row in enumerate(unpacked(arrays[f"{prefix}/rows"])):
                rays = values[at * len(angles) : (at + 1) * len(angles)]
                commands.append([1.0, *steer(headings[at], angles, rays, received.get(row, ())), 0.0])
                messages += struct.pack("<Hf", TAG, headings[at])
                rows.append(row)
    n = len(rows)
    return {
        "rows": packed("<i8", [n], rows),
        "command": packed("<f8", [4, n], [command[which] for which in range(4) for command in commands]),
        "sent": packed("<i8", [2, n], [*rows, *[BROADCAST] * n]),
        "sent/data": ["|u1", [len(messages)], messages],
        "sent/offset": packed("<i8", [n + 1], range(0, len(messages) + 1, 6)),
    }


def opened(arguments: argparse.Namespace) -> zenoh.Session:
    """A client of the endpoint, and of nobody else."""
    off = {"enabled": False}
    certificate = {"connect_certificate": arguments.certificate, "connect_private_key": arguments.key}
    config: dict[str, Any] = {"mode": "client", "connect": {"endpoints": [arguments.endpoint], "timeout_ms": 10000}}
    config["scouting"] = {"multicast": off, "gossip": off}
    if arguments.ca:
        tls = {"root_ca_certificate": arguments.ca, "enable_mtls": True, **certificate}
        config["transport"] = {"link": {"tls": tls}}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def play(session: zenoh.Session, root: str, name: str, robots: int | None) -> None:
    arrived: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    into, block = (arrived.put, arrived), zenoh.CongestionControl.BLOCK
    declared = [  # kept: zenoh takes back what nobody holds
        session.declare_subscriber(f"{root}/frame/{name}", into),
        session.liveliness().declare_subscriber(f"{root}/world", into),
        session.liveliness().declare_token(f"{root}/alive/{name}"),
    ]
    answers = session.declare_publisher(f"{root}/answer/{name}", congestion_control=block, express=True)
    request = msgpack.packb({"v": VERSION, "robots": robots, "names": None, "agents": None})
    reply = next(iter(session.get(f"{root}/join/{name}", payload=request, timeout=30.0)))
    if reply.ok is None:
        raise SystemExit(f"refused: {reply.err.payload.to_string() if reply.err else ''}")
    assignment = msgpack.unpackb(reply.ok.payload.to_bytes())
    answers.put(frame("ready", -1, {}, {}))
    while (sample := arrived.get()).kind == zenoh.SampleKind.PUT:  # else the world's token, and the world, is gone
        message = msgpack.unpackb(sample.payload.to_bytes())
        if message["kind"] == "end":
            break
        try:
            answers.put(frame("actions", message["tick"], acted(message["arrays"], assignment), {}))
        except Exception:  # whatever it is, the world is told before it is raised
            answers.put(frame("failed", -1, {}, {"robots": name, "traceback": traceback.format_exc()}))
            raise
    del declared


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    for option in ("endpoint", "--name", "--run", "--ca", "--certificate", "--key"):
        parser.add_argument(option, default={"--name": "plain", "--run": "*"}.get(option))
    parser.add_argument("--robots", type=int)
    options = parser.parse_args()
    joined = opened(options)
    world = joined.liveliness().declare_subscriber(f"swarmwire/{options.run}/world", history=True).recv()
    play(joined, str(world.key_expr).removesuffix("/world"), options.name, options.robots)
