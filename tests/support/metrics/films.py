"""Films made by hand, run folders that hold them, and an independent reader of pcapng files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Group, Light, Static
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.pictures.drawing.film import Film

OBSTACLES = (
    Obstacle("cylinder", 2.0, 2.0, radius_m=0.4),
    Obstacle("box", -2.0, 2.0, 0.5, size_m=(0.8, 0.6)),
    Obstacle("polygon", 0.0, 2.0, points_m=((-0.4, -0.3), (0.4, -0.3), (0.0, 0.5))),
)
LIGHT = Light(2.5, -2.0, 4.0)


def two_groups(arenas: int = 1) -> Static:
    """Two e-pucks and a foot-bot in 8 x 6 m, with an obstacle of each shape and a light."""
    return Static(
        name="hand-made",
        seeds=tuple(range(1, arenas + 1)),
        rate_hz=10,
        arena_size_m=(8.0, 6.0),
        boundary="walls",
        obstacles=(OBSTACLES,) * arenas,
        groups=(Group("small", load_body("epuck"), 0, 2), Group("large", load_body("footbot"), 2, 3)),
        robot_names=("small-0", "small-1", "large-0"),
        range_m=2.0,
        lights=((LIGHT,),) * arenas,
    )


def film(ticks: int = 31, **changes: Any) -> Film:
    """All move along +x by 5 cm a tick: from (-3, -1) and (-1.5, -1), which are in range, and from (0, -2.5), which is
    in nobody's."""
    pose = np.zeros((ticks, 3, 3), np.float32)
    pose[:, :, :2] = [(-3.0, -1.0), (-1.5, -1.0), (1.0, -2.5)]
    pose[:, :, 0] += 0.05 * np.arange(ticks)[:, None]
    fields: dict[str, Any] = {
        "static": two_groups(),
        "arena": 0,
        "time_s": np.arange(ticks) / 10,
        "pose": pose,
        "alive": np.ones((ticks, 3), np.bool_),
        "metrics": {"order": np.linspace(0.0, 1.0, ticks), "min_gap": np.full(ticks, np.nan)},
    }
    return Film(**{**fields, **changes})


def ticks_frame(recording: Film, states: Any = None, arena: int = 0) -> pl.DataFrame:
    """A film as the rows of a run folder."""
    count, robots = recording.alive.shape
    columns = {"arena": pl.Series(np.full(count, arena, np.int32)), "tick": pl.Series(np.arange(count))}
    columns["time_s"] = pl.Series(recording.time_s)
    for index, name in enumerate(("x_m", "y_m", "heading_rad")):
        columns[name] = pl.Series(list(recording.pose[:, :, index]), dtype=pl.Array(pl.Float32, robots))
    columns["alive"] = pl.Series(recording.alive.tolist(), dtype=pl.Array(pl.Boolean, robots))
    noted = [[""] * robots] * count if states is None else states
    columns["state"] = pl.Series(noted, dtype=pl.Array(pl.String, robots))
    for name, value in recording.metrics.items():
        columns[name] = pl.Series(value).fill_nan(None)
    return pl.DataFrame(columns)


class Folder:
    """A run folder as far as films need it: Parquet, in parts while a run goes on."""

    def __init__(self, path: Path, static: Static | None = None) -> None:
        self.path, self.static = path, static or two_groups()
        self.measured: dict[str, MetricInfo] = {}

    def files(self, name: str) -> list[Path]:
        return list(self.path.glob(f"{name}.parquet"))

    def ticks(self, arena: int | None = None) -> pl.DataFrame:
        file = self.path / "ticks.parquet"
        frame = pl.read_parquet(file if file.exists() else self.path / "ticks" / "part-*.parquet")
        return frame if arena is None else frame.filter(pl.col("arena") == arena)


@dataclass
class Captured:
    """A packet as it stands in a file."""

    at_ns: int
    data: bytes
    length: int
    comments: list[str]


@dataclass
class Capture:
    """A file: its options as text or bytes by code, its link type and packets."""

    section: dict[int, list[bytes]]
    interface: dict[int, list[bytes]]
    link_type: int
    packets: list[Captured]


def read(path: Path) -> Capture:
    """The whole of a file with one section and one interface."""
    blocks = list(_blocks(path.read_bytes()))
    assert [kind for kind, _ in blocks[:2]] == [0x0A0D0D0A, 1]
    head, interface = blocks[0][1], blocks[1][1]
    assert head[:16].hex() == "4d3c2b1a" + "01000000" + "ff" * 8
    assert all(kind == 6 for kind, _ in blocks[2:])
    packets = [_packet(body) for _, body in blocks[2:]]
    return Capture(_options(head[16:]), _options(interface[8:]), _number(interface, 0, 2), packets)


def _blocks(data: bytes):
    at = 0
    while at < len(data):
        kind, length = _number(data, at, 4), _number(data, at + 4, 4)
        assert length % 4 == 0
        assert length == _number(data, at + length - 4, 4)
        yield kind, data[at + 8 : at + length - 4]
        at += length
    assert at == len(data)


def _packet(body: bytes) -> Captured:
    interface, high, low, captured, length = (_number(body, 4 * index, 4) for index in range(5))
    assert interface == 0
    padded = captured + -captured % 4
    assert body[20 + captured : 20 + padded] == bytes(padded - captured)
    comments = [text.decode() for text in _options(body[20 + padded :]).get(1, [])]
    return Captured(high * 2**32 + low, body[20 : 20 + captured], length, comments)


def _options(data: bytes) -> dict[int, list[bytes]]:
    options: dict[int, list[bytes]] = {}
    while data:
        code, length = _number(data, 0, 2), _number(data, 2, 2)
        if code == 0:
            assert data == bytes(4)
            break
        options.setdefault(code, []).append(data[4 : 4 + length])
        data = data[4 + length + -length % 4 :]
    return options


def _number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")
