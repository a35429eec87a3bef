"""Logs of real robots, made of emulated runs."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.clock import to_s
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import run
from tests.support.deploy.runs import LOSSY

BEGAN_S = 1_767_225_600.0
TICKS = "tick,t_s,late,x_m,y_m,heading_rad,drive,linear_mps,angular_radps,state,value,charge"
RECEIVED = "t_s,tx,rx,seq,to,size_bytes,tag,latency_s,distance_m,given"
SENT = "t_s,tx,seq,to,size_bytes,tag,fate"
SMALL = ("duration_s=20", "robots.flock.count=6", "arena.size_m=[6.0, 6.0]", "arena.obstacles=[]")
METRICS = 'metrics=["speed", "cohesion", "link_pdr", "latency_air"]'


class Watched(Observer):
    """Observer that keeps all truths of a run of one arena."""

    def begin(self, static: Static) -> None:
        self.static, self.truths = static, list[Truth]()

    def see(self, truth: Truth) -> None:
        self.truths.append(truth)


def as_logs(
    of: Watched,
    folder: Path,
    *,
    phase_s: Sequence[float] | None = None,
    ahead_s: Mapping[str, float] | None = None,
    tracker: bool = True,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Write a folder per robot; its steps begin `phase_s` after the ticks, its clock is `ahead_s` of the others'."""
    static = of.static
    begins_s = np.array([to_s(truth.time_ns) for truth in of.truths])
    pose = np.stack([truth.pose for truth in of.truths])
    pose[:, :, 2] = np.unwrap(pose[:, :, 2], axis=0)
    sent, received = _radio(of)
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
            truth = of.truths[tick]
            x_m, y_m, heading_rad = (float(column[tick]) for column in columns)
            heading_rad = (heading_rad + np.pi) % (2.0 * np.pi) - np.pi
            told = f"{x_m:.6f},{y_m:.6f},{heading_rad:.6f}" if tracker else ",,"
            forward, turn, _ = truth.command[robot]
            value = "" if truth.value is None or np.isnan(truth.value[robot]) else f"{truth.value[robot]}"
            state = truth.states[truth.state[robot]]
            lines.append(f"{tick},{clock_s + time_s:.9f},0,{told},1,{forward:.6f},{turn:.6f},{state},{value},")
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


def _radio(of: Watched) -> tuple[list[list[Any]], list[list[Any]]]:
    """By robot what it sent, and what it received, in the order of time."""
    names, robots = of.static.robot_names, of.static.robots
    sent: list[dict[int, Any]] = [{} for _ in range(robots)]
    received: list[list[Any]] = [[] for _ in range(robots)]
    sizes: dict[tuple[int, int], int] = {}
    for truth in of.truths:
        if truth.finished is None or truth.departed is None:
            continue
        ended, gone = truth.finished, truth.departed
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
        for row in range(len(gone.sender)):
            sender, seq, to = int(gone.sender[row]), int(gone.sequence[row]), int(gone.to[row])
            told = (int(gone.on_air_at_ns[row]), seq, names[to] if to >= 0 else "", sizes.get((sender, seq), 14))
            sent[sender].setdefault(seq, told)
    return [sorted(of_robot.values()) for of_robot in sent], [sorted(of_robot) for of_robot in received]


def watched(*overrides: str, seed: int = 1, out: Path | None = None) -> Watched:
    """All truths of a run."""
    of = Watched()
    run(LOSSY, overrides=[*SMALL, METRICS, *overrides], seed=seed, out=out, observers=[of])
    return of


@cache
def flock() -> Watched:
    """The same run for all tests: everybody is in range."""
    return watched("radio.range_m=20")
