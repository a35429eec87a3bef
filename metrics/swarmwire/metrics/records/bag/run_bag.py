"""A run's arena as an MCAP file: transforms, true poses, commands, packets, metrics and events of each tick.

| topic | type | content |
| --- | --- | --- |
| /tf | TFMessage | the frame ROBOT/base_link of every robot in `map` |
| /ROBOT/ground_truth | Odometry | true pose in `map`, true velocity in the robot's frame |
| /ROBOT/cmd_vel | Twist | the command within the limits of the drive |
| /ROBOT/state, /ROBOT/value | String, Float64 | what the agent noted, when it changes |
| /packets, /packets/lines | swarmwire_msgs/Packet, MarkerArray | fates at receivers, when they become final |
| /metrics/NAME | Float64 | metrics, and the radio's counts, where they are defined |
| /events | rcl_interfaces/Log | events of the scenario and of people |
| /arena, /bodies, /movables | MarkerArray | arena, robots and pushed obstacles, when they change |

Times are those of the run, from 0. The tables are read in pieces, so that runs need not fit into the memory.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.protocols.ros2.bags import BagWriter
from swarmwire.comms.protocols.ros2.keys import ODOMETRY, TRANSFORMS, TWIST, ros_name, ros_names
from swarmwire.comms.protocols.ros2.messages import PACKET, Velocities, encode_twist
from swarmwire.comms.protocols.ros2.motion import BASE_FRAME, FramePose, odometry
from swarmwire.comms.protocols.ros2.transforms import transforms
from swarmwire.metrics.records.bag.markers import (
    MAP,
    MARKERS,
    Mark,
    Scenery,
    body_marks,
    marker_array,
    packet_marks,
)
from swarmwire.metrics.records.run_folder.layout import (
    COMMAND,
    HEIGHT,
    MOVABLE,
    POSE,
    RADIO,
    SIDEWAYS,
    VALUE,
    VELOCITY,
)
from swarmwire.metrics.records.run_folder.packets import PacketsTable
from swarmwire.metrics.records.run_folder.reader import RunFolder

FLOAT, STRING, LOG = "std_msgs/msg/Float64", "std_msgs/msg/String", "rcl_interfaces/msg/Log"
INFO, WARNING = 20, 30  # levels of a Log
CHUNK_ROBOT_TICKS = 20_000  # robots x ticks that are read at once
EXACT = (np.zeros(36), np.zeros(36))  # covariances of true poses and velocities


class RunBag:
    """An arena of a run folder as an MCAP file that is being written.

    Attributes:
        bag: the file.
    """

    def __init__(self, file: IO[bytes], folder: RunFolder, arena: int) -> None:
        """Begin a file; BadInput if the libraries are not installed, or two robots have the same name in ROS."""
        self._folder, self._static, self._arena = folder, folder.static, arena
        self._robots = ros_names(self._static.robot_names, str(folder.path))
        self._frames = tuple(f"{robot}/{BASE_FRAME}" for robot in self._robots)
        self._scenery = Scenery(self._static, arena)
        self._has_packets = bool(folder.files(PacketsTable.name))
        self._latest: dict[str, Any] = {}  # content of the topics that are written when it changes
        self.bag = BagWriter(file)

    def write(self, ticks: range) -> Iterator[int]:
        """Write these ticks and the index of the file; yields each tick when it is written."""
        events = self._folder.events(self._arena) if self._folder.files("events") else None
        size, before_ns = max(1, CHUNK_ROBOT_TICKS // self._static.robots), -1
        for first in range(ticks.start, ticks.stop, size):
            rows = pl.col("tick").is_between(first, min(first + size, ticks.stop) - 1)
            table = self._folder.table("ticks", self._arena, rows=rows).sort("tick")
            if table.is_empty():  # rows that a slow disk cost a run in real time
                continue
            chunk = _Chunk.read(table, self._static)
            packets, ends = self._packets(chunk.time_ns[0] if before_ns < 0 else before_ns, chunk.time_ns)
            for row, time_ns in enumerate(chunk.time_ns):
                self._write_packets(packets[ends[row] : ends[row + 1]], chunk, row)
                self._write_scene(chunk, row, time_ns)
                self._write_motion(chunk, row, time_ns)
                for name, values in chunk.numbers.items():
                    if np.isfinite(values[row]):
                        self._write(f"/metrics/{ros_name(name)}", FLOAT, time_ns, float(values[row]))
                if events is not None:
                    self._write_events(events.filter(pl.col("tick") == chunk.ticks[row]), time_ns)
                yield chunk.ticks[row]
            before_ns = chunk.time_ns[-1]
        self.bag.close()

    def _write(self, topic: str, kind: str, time_ns: int, *fields: Any) -> None:
        self.bag.write(topic, kind, self.bag.messages.make(kind, *fields), time_ns)

    def _write_changed(self, topic: str, kind: str, time_ns: int, content: Any) -> None:
        """Write a message of one field if its content is another than that of the topic's latest message."""
        if self._latest.get(topic) != content:
            self._latest[topic] = content
            self._write(topic, kind, time_ns, content)

    def _write_markers(self, topic: str, marks: list[Mark], time_ns: int) -> None:
        self.bag.write(topic, MARKERS, marker_array(self.bag.messages, marks, time_ns), time_ns)

    def _write_scene(self, chunk: "_Chunk", row: int, time_ns: int) -> None:
        alive, movable = chunk.alive[row], chunk.movable[row]
        for topic, key, marks in (
            ("/arena", b"", self._scenery.fixed),
            ("/bodies", alive.tobytes(), lambda: body_marks(self._static, self._frames, alive)),
            ("/movables", movable.tobytes(), lambda: self._scenery.movable(movable)),
        ):
            if self._latest.get(topic) != key and (topic != "/movables" or len(movable)):
                self._latest[topic] = key
                self._write_markers(topic, marks(), time_ns)

    def _write_motion(self, chunk: "_Chunk", row: int, time_ns: int) -> None:
        messages = self.bag.messages
        poses = [
            FramePose(MAP, frame, x_m, y_m, heading_rad, z_m)
            for frame, (x_m, y_m, heading_rad), z_m in zip(
                self._frames, chunk.pose[row].tolist(), chunk.z_m[row].tolist(), strict=True
            )
        ]
        self.bag.write("/tf", TRANSFORMS, transforms(messages, tuple(poses), time_ns), time_ns)
        velocity, command = chunk.velocity[row].tolist(), chunk.command[row].tolist()
        for robot, name in enumerate(self._robots):
            forward_mps, left_mps, turn_radps = velocity[robot]
            true = Velocities(forward_mps, turn_radps, left_mps)
            self.bag.write(
                f"/{name}/ground_truth", ODOMETRY, odometry(messages, poses[robot], true, EXACT, time_ns), time_ns
            )
            self.bag.write_encoded(f"/{name}/cmd_vel", TWIST, encode_twist(Velocities(*command[robot])), time_ns)
            if chunk.state is not None:
                self._write_changed(f"/{name}/state", STRING, time_ns, chunk.state[row][robot] or "")
            if chunk.value is not None and np.isfinite(value := chunk.value[row, robot]):
                self._write_changed(f"/{name}/value", FLOAT, time_ns, float(value))

    def _packets(self, after_ns: int, time_ns: list[int]) -> tuple[pl.DataFrame, list[int]]:
        """Return the packets that ended in a chunk of ticks, and the first row of each tick and its end."""
        if not self._has_packets:
            return pl.DataFrame(), [0] * (len(time_ns) + 1)
        ended = pl.col("final_at_ns").is_between(after_ns, time_ns[-1], closed="right")
        packets = self._folder.validated(PacketsTable.name, self._arena, ended).sort("final_at_ns", maintain_order=True)
        return packets, [0, *np.searchsorted(packets["final_at_ns"].to_numpy(), time_ns, side="right").tolist()]

    def _write_packets(self, packets: pl.DataFrame, chunk: "_Chunk", row: int) -> None:
        if packets.is_empty():
            return
        messages, names = self.bag.messages, (*self._robots, "")  # -1: none, or all
        for packet in packets.iter_rows(named=True):
            final_ns = packet["final_at_ns"]
            self._write(
                "/packets",
                PACKET,
                final_ns,
                messages.header(final_ns, MAP),
                messages.time(packet["sent_at_ns"]),
                messages.time(packet["on_air_at_ns"]),
                names[packet["sender"]],
                names[-1 if packet["receiver"] is None else packet["receiver"]],
                names[-1 if packet["to"] is None else packet["to"]],
                packet["fate"],
                packet["receivers"],
                packet["sequence"],
                packet["topic"],
                packet["size_bytes"],
                np.nan if packet["distance_m"] is None else packet["distance_m"],
                np.nan if packet["rssi_dbm"] is None else packet["rssi_dbm"],
                np.frombuffer(packet["payload"] or b"", np.uint8),
            )
        links = packets.drop_nulls("receiver")
        ends, fate = links.select("sender", "receiver").to_numpy(), links["fate"].to_physical().to_numpy()
        lifetime_ns = NS_PER_S // self._static.rate_hz
        marks = packet_marks(self._static, chunk.center_m(row, self._static), ends, fate, lifetime_ns)
        self._write_markers("/packets/lines", marks, chunk.time_ns[row])

    def _write_events(self, events: pl.DataFrame, time_ns: int) -> None:
        for event in events.iter_rows(named=True):
            words = " ".join(filter(None, (event["do"], event["part"], "ended" if event["ended"] else "")))
            text = f"{words}: {', '.join(map(ros_name, event['robots']))}" if event["robots"] else words
            level = INFO if event["ended"] else WARNING
            self._write("/events", LOG, time_ns, self.bag.messages.time(time_ns), level, event["do"], text, "", "", 0)


@dataclass(frozen=True)
class _Chunk:
    """Consecutive ticks of an arena, for T ticks and n robots."""

    ticks: list[int]
    time_ns: list[int]
    pose: AnyArray  # (T, n, 3)
    z_m: AnyArray  # (T, n) lower side above the floor
    velocity: FloatArray  # (T, n, 3) ahead and to the left in m/s, rad/s, in the robot's frame
    command: AnyArray  # (T, n, 3) fields of `Velocities`
    alive: AnyArray  # (T, n)
    state: list[list[str | None]] | None  # (T, n) None: no robot noted a state
    value: AnyArray | None  # (T, n) NaN: none
    movable: AnyArray  # (T, movable obstacles, 3)
    numbers: dict[str, FloatArray]  # metrics and the radio's counts, (T,) each; NaN: undefined

    @classmethod
    def read(cls, table: pl.DataFrame, static: Static) -> "_Chunk":
        """Return the rows of the table `ticks`."""

        def stacked(names: tuple[str, ...]) -> AnyArray:
            return np.stack([table[name].to_numpy().astype(np.float64) for name in names], axis=-1)

        pose, velocity, shape = stacked(POSE), stacked(VELOCITY), (len(table), static.robots)
        c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
        ahead_mps, left_mps = c * velocity[..., 0] + s * velocity[..., 1], c * velocity[..., 1] - s * velocity[..., 0]
        altitude_m = [group.body.altitude_m for group in static.groups for _ in range(group.start, group.stop)]
        sideways = stacked((SIDEWAYS,)) if SIDEWAYS in table.columns else np.zeros((*shape, 1))
        numbers = [name for name, kind in table.schema.items() if kind == pl.Float64 and name != "time_s"]
        return cls(
            ticks=table["tick"].to_list(),
            time_ns=np.round(NS_PER_S * table["time_s"].to_numpy()).astype(np.int64).tolist(),
            pose=pose,
            z_m=stacked((HEIGHT,))[..., 0] if HEIGHT in table.columns else np.broadcast_to(altitude_m, shape),
            velocity=np.stack([ahead_mps, left_mps, velocity[..., 2]], axis=-1),
            command=np.concatenate([stacked(COMMAND), sideways], axis=-1),
            alive=table["alive"].to_numpy(),
            state=table["state"].to_list() if table["state"].explode().str.len_bytes().sum() else None,
            value=stacked((VALUE,))[..., 0] if VALUE in table.columns else None,
            movable=stacked(MOVABLE) if static.movable else np.zeros((len(table), 0, 3)),
            numbers={name: table[name].cast(pl.Float64).fill_null(np.nan).to_numpy() for name in (*numbers, *RADIO)},
        )

    def center_m(self, row: int, static: Static) -> FloatArray:
        """Return the centres of the robots at a tick, (n, 3)."""
        height_m = [group.body.height_m for group in static.groups for _ in range(group.start, group.stop)]
        return np.column_stack([self.pose[row, :, :2], self.z_m[row] + 0.5 * np.array(height_m)])
