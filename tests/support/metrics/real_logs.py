"""Logs of real robots, made of emulated runs."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.clock import to_s
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import run
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.network.latency import RadioTally
from tests.support.deploy.runs import LOSSY

BEGAN_S = 1_767_225_600.0
TICKS = "tick,t_s,late,x_m,y_m,heading_rad,drive,linear_mps,angular_radps,state,value,charge"
RECEIVED = "t_s,tx,rx,seq,to,size_bytes,tag,latency_s,distance_m,given"
SENT = "t_s,tx,seq,to,size_bytes,tag,fate"
FILES = ("ticks", "sent", "received")
SMALL = ("duration_s=20", "robots.flock.count=6", "arena.size_m=[6.0, 6.0]", "arena.obstacles=[]")
METRICS = 'metrics=["speed", "cohesion", "link_pdr", "latency_air"]'


class Watched(Observer):
    """Observer that keeps all truths of a run of one arena."""

    def begin(self, static: Static) -> None:
        self.static, self.truths = static, list[Truth]()

    def see(self, truth: Truth) -> None:
        self.truths.append(truth)


def as_logs(
    watched: Watched,
    folder: Path,
    *,
    phase_s: Sequence[float] | None = None,
    ahead_s: Mapping[str, float] | None = None,
    tracker: bool = True,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Write a folder per robot; its steps begin `phase_s` after the ticks, its clock is `ahead_s` of the others'."""
    static = watched.static
    begins_s = np.array([to_s(truth.time_ns) for truth in watched.truths])
    pose = np.stack([truth.pose for truth in watched.truths])
    pose[:, :, 2] = np.unwrap(pose[:, :, 2], axis=0)
    sent, received = _radio(watched)
    group = static.groups[0]
    for robot, name in enumerate(static.robot_names):
        own = folder / name
        own.mkdir(parents=True)
        clock_s = BEGAN_S + (ahead_s or {}).get(name, 0.0)
        says = {
            "format": 1,
            "name": name,
            "index": robot,
            "swarm": "lab",
            "robots": list(static.robot_names),
            "agent": "swarmwire.agent.behaviours:Flocking",
            "agent_sha256": "0" * 64,
            "params": {"separation_m": 0.8},
            "body": group.body.as_mapping(),
            "driver": {"name": "emulated"},
            "radio": {"kind": "zenoh"},
            "rate_hz": static.rate_hz,
            "started_utc_ns": 1_000_000_000,
        }
        (own / "robot.json").write_text(json.dumps({**says, **(about or {})}))
        at_s = begins_s + (phase_s[robot] if phase_s else 0.0)
        at_s = at_s[at_s <= begins_s[-1]]
        columns = [np.interp(at_s, begins_s, pose[:, robot, axis]) for axis in range(3)]
        lines = [TICKS]
        for tick, time_s in enumerate(at_s.tolist()):
            truth = watched.truths[tick]
            x_m, y_m, heading_rad = (float(column[tick]) for column in columns)
            heading_rad = (heading_rad + np.pi) % (2.0 * np.pi) - np.pi
            position = f"{x_m:.6f},{y_m:.6f},{heading_rad:.6f}" if tracker else ",,"
            forward, turn, _ = truth.command[robot]
            value = "" if truth.value is None or np.isnan(truth.value[robot]) else f"{truth.value[robot]}"
            state = truth.states[truth.state[robot]]
            lines.append(f"{tick},{clock_s + time_s:.9f},0,{position},1,{forward:.6f},{turn:.6f},{state},{value},")
        (own / "ticks.csv").write_text("\n".join(lines) + "\n")
        rows = [f"{clock_s + to_s(at):.9f},{name},{seq},{to},{size},say,sent" for at, seq, to, size in sent[robot]]
        (own / "sent.csv").write_text("\n".join([SENT, *rows]) + "\n")
        rows = []
        for at, sender, seq, to, size, sent_at, distance_m in received[robot]:
            tx = static.robot_names[sender]
            late_s = to_s(at - sent_at) + (ahead_s or {}).get(name, 0.0) - (ahead_s or {}).get(tx, 0.0)
            far = f"{distance_m:.4f}" if tracker else ""
            rows.append(f"{clock_s + to_s(at):.9f},{tx},{name},{seq},{to},{size},say,{late_s:.9f},{far},1")
        (own / "received.csv").write_text("\n".join([RECEIVED, *rows]) + "\n")
        (own / "summary.json").write_text(json.dumps({"ended": "stopped", "ticks": len(at_s), "counts": {}}))
    return folder


def _radio(watched: Watched) -> tuple[list[list[Any]], list[list[Any]]]:
    """By robot what it sent, and what it received, in the order of time."""
    names, robots = watched.static.robot_names, watched.static.robots
    sent: list[dict[int, Any]] = [{} for _ in range(robots)]
    received: list[list[Any]] = [[] for _ in range(robots)]
    sizes: dict[tuple[int, int], int] = {}
    for truth in watched.truths:
        if truth.finished is None or truth.departed is None:
            continue
        ended, departed = truth.finished, truth.departed
        for row in range(len(ended.sender)):
            sender, receiver, seq = int(ended.sender[row]), int(ended.receiver[row]), int(ended.sequence[row])
            at, to = int(ended.sent_at_ns[row]), int(ended.to[row])
            size = sizes[sender, seq] = int(ended.size_bytes[row])
            sent[sender][seq] = (at, seq, names[to] if to >= 0 else "", size)
            if ended.fate[row] == Fate.RECEIVED:
                apart = truth.pose[sender, :2] - truth.pose[receiver, :2]
                addressed = names[to] if to >= 0 else ""
                final = int(ended.final_at_ns[row])
                received[receiver].append((final, sender, seq, addressed, size, at, float(np.hypot(*apart))))
        for row in range(len(departed.sender)):
            sender, seq, to = int(departed.sender[row]), int(departed.sequence[row]), int(departed.to[row])
            packet = (int(departed.on_air_at_ns[row]), seq, names[to] if to >= 0 else "", sizes.get((sender, seq), 14))
            sent[sender].setdefault(seq, packet)
    return [sorted(of_robot.values()) for of_robot in sent], [sorted(of_robot) for of_robot in received]


def watched(*overrides: str, seed: int = 1, out: Path | None = None) -> Watched:
    """All truths of a run."""
    observer = Watched()
    run(LOSSY, overrides=[*SMALL, METRICS, *overrides], seed=seed, out=out, observers=[observer])
    return observer


def measured_run(watched: Watched, metrics: Sequence[Metric]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The series of metrics of a run by name, and its account of the radio."""
    observer, tally = Metrics(metrics), RadioTally()
    values: list[np.ndarray] = []
    for each in (observer, tally):
        each.begin(watched.static)
    for truth in watched.truths:
        observer.see(truth)
        tally.see(truth)
        values.append(observer.values[:, 0].copy())
    series = dict(zip((metric.name for metric in metrics), np.array(values).T, strict=True))
    return series, tally.end(None)["radio"][0]


@cache
def flock() -> Watched:
    """The same run for all tests: everybody is in range."""
    return watched("radio.range_m=20")


def as_bag(logs: Path, to: Path, *, commands: bool = True, packets: bool = True, first_text: str = "") -> Path:
    """Write a bag of ROS 2 from the logs of a swarm: /NAME/pose, and by default /NAME/cmd_vel and /NAME/packets.

    A packet's text has no latency: it follows from the times of both ends.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    make: dict[str, Any] = {name.rpartition("/")[2]: kind for name, kind in store.types.items() if "/msg/" in name}
    messages: list[tuple[int, str, str, Any]] = []
    for folder in sorted(logs.iterdir()):
        name = folder.name.replace("-", "_")
        ticks, sent, received = (
            pl.read_csv(folder / f"{part}.csv", infer_schema=False).fill_null("").to_dicts() for part in FILES
        )
        for row in ticks:
            at_ns = round(float(row["t_s"]) * 1e9)
            header, turn = make["Header"](make["Time"](*divmod(at_ns, 10**9)), "map"), float(row["heading_rad"]) / 2.0
            where = make["Point"](float(row["x_m"]), float(row["y_m"]), 0.0)
            pose = make["Pose"](where, make["Quaternion"](0.0, 0.0, np.sin(turn), np.cos(turn)))
            messages.append(
                (at_ns, f"/{name}/pose", "geometry_msgs/msg/PoseStamped", make["PoseStamped"](header, pose))
            )
            ahead, left = (
                make["Vector3"](*part)
                for part in ((float(row["linear_mps"]), 0.0, 0.0), (0.0, 0.0, float(row["angular_radps"])))
            )
            twist, kind = make["Twist"](ahead, left), "Twist"
            if name.endswith("_0"):  # its stamp counts, not the time at which it was recorded
                twist, kind = make["TwistStamped"](header, twist), "TwistStamped"
            if commands:
                messages.append(
                    (at_ns + (kind != "Twist") * 10**9, f"/{name}/cmd_vel", f"geometry_msgs/msg/{kind}", twist)
                )
        for row in (*sent, *received) if packets else ():
            text: dict[str, Any] = {"t_s": float(row["t_s"])} | {key: int(row[key]) for key in ("seq", "size_bytes")}
            ends = {"to": row["to"], "tx": row["tx"] if "rx" in row else ""}
            text |= {key: name.replace("-", "_") for key, name in ends.items() if name}
            packet, first_text = make["String"](first_text or json.dumps(text)), ""
            messages.append((round(float(row["t_s"]) * 1e9), f"/{name}/packets", "std_msgs/msg/String", packet))
    with Writer(to, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics: dict[str, Any] = {}
        for at_ns, topic, kind, message in sorted(messages, key=lambda entry: entry[0]):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], at_ns, store.serialize_cdr(message, kind))
    return to / f"{to.name}.mcap"
