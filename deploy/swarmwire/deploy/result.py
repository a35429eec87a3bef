"""What a run comes to: the summary as a typed result."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from swarmwire.deploy.record.inputs import InputsRecord
from swarmwire.deploy.record.live_events import LiveEventsRecord
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.campaign.spec import CopiedFile
from swarmwire.metrics.run_folder.layout import SUMMARY_FORMAT
from swarmwire.world.backends.realtime_backend import RealTimeReport
from swarmwire.world.backends.registry import RunnerEvent


@dataclass(frozen=True)
class Statistics:
    """A metric over the ticks of a run; None where it had no value."""

    final: float | None
    mean: float | None
    min: float | None
    max: float | None


@dataclass(frozen=True)
class Percentiles:
    """Percentiles in s; None if nothing was received."""

    p50: float | None
    p90: float | None
    p99: float | None


@dataclass(frozen=True)
class RadioResult:
    """What became of every packet of one arena."""

    sent: int  # packets
    intended: int  # receivers that they were meant for
    in_range: int  # of these, receivers in range
    fates: dict[str, int]  # receivers; they add up to `intended`
    pdr: float | None  # packet delivery ratio: received / intended; None without intended receivers
    link_pdr: float | None  # delivery ratio of links: received / in_range; None if no receiver was in range
    latency_air_s: Percentiles  # from sending to hearing
    latency_agent_s: Percentiles  # from sending to the tick at which the receiver could act


@dataclass(frozen=True)
class ArenaResult:
    """What came of one arena."""

    seed: int
    ended: str  # "stopped", if it was over before the run was; else as the run
    ticks: int  # that it took part in
    sim_time_s: float
    trajectory_sha256: str
    counts: dict[str, int]  # of the run's, those that belong to it, by name; only what is not 0
    radio: RadioResult | None
    metrics: dict[str, Statistics]
    stop_time_s: float | None  # since when what ended it had held; None: nothing came to hold (censored at sim_time_s)
    stopped_by: str | None  # what ended it, in words: "order at least 0.9 for 5 s"

    def end(self) -> dict[str, Any]:
        """When, how and why it ended, as the summary says it, and what was not as it should be."""
        names = ("ended", "ticks", "sim_time_s", "stop_time_s", "stopped_by", "counts")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class EventResult:
    """An event that took effect, or ended after its time."""

    at_s: float  # of the scenario; of what happens singly, the tick's start
    tick: int  # in which it did
    do: str
    part: str  # that fails; of other actions empty
    ended: bool
    singly: bool  # each robot at a time of its own: batteries that run down, failures at a rate
    robots: list[list[str]]  # names of those that it changed, per arena


@dataclass(frozen=True)
class Result:
    """One execution: the same as `summary.json`."""

    scenario: str
    robots: int  # in each arena
    engine: str  # that moved the bodies: "discs", "pymunk", "kinematic", or two of them joined by " and "
    runners: int  # 0: all agents in the world's process
    mode: str  # "local" | "lockstep" | "realtime"
    ended: str  # "duration" | "stopped" (all arenas) | "interrupted" | "left" (by whoever stepped it) | "failed"
    ticks: int  # of the arena that ran longest
    sim_time_s: float
    wall_time_s: float  # of the loop
    start_time_s: float  # from the call to the first tick
    arenas: tuple[ArenaResult, ...]
    global_sensors: dict[str, list[str]]  # bodies that know more than their surroundings, and by which sense
    events: tuple[EventResult, ...]  # in order
    counts: dict[str, int]  # late, missing, malformed, clipped: whatever was not as it should be, by name
    cpu: str
    versions: dict[str, str]
    modules: dict[str, str]  # sha256 of the installed code: swarmwire's parts and packages of agents
    stop: tuple[str, ...] = ()  # what ends an arena, in words: "order at least 0.9 for 5 s"
    files: tuple[CopiedFile, ...] = ()  # in the run folder, from which the run can be repeated
    inputs: InputsRecord | None = None  # what came from outside, if anything did
    live_events: LiveEventsRecord | None = None  # what people did to it while it went on, if anything
    lost_runners: tuple[str, ...] = ()  # that the run survived: name, robots and reason
    runner_events: tuple[RunnerEvent, ...] = ()  # who joined, left, was lost and returned, in order
    realtime: RealTimeReport | None = None
    gateways: dict[str, str] = field(default_factory=dict[str, str])  # by group: the kind, where it has one
    error: str | None = None  # why it failed
    record: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]], compare=False)  # tables
    out: Path | None = field(default=None, compare=False)  # the run folder

    @property
    def realtime_factor(self) -> float:
        """Simulated time over the wall time of the loop."""
        return self.sim_time_s / self.wall_time_s if self.wall_time_s > 0 else 0.0

    @property
    def trajectory_sha256(self) -> list[str]:
        """The trajectory hash of each arena."""
        return [arena.trajectory_sha256 for arena in self.arenas]

    @property
    def radio(self) -> RadioResult | None:
        """The radio of the first arena."""
        return self.arenas[0].radio

    @property
    def metrics(self) -> dict[str, Statistics]:
        """The metrics of the first arena."""
        return self.arenas[0].metrics

    def summary(self) -> dict[str, Any]:
        """The content of `summary.json`: with several arenas, what differs between them is a list, an item for each."""
        radios = [asdict(arena.radio) if arena.radio else None for arena in self.arenas]
        metrics = [{name: asdict(value) for name, value in arena.metrics.items()} for arena in self.arenas]
        one = len(self.arenas) == 1
        events = [{**asdict(event), "robots": event.robots[0] if one else event.robots} for event in self.events]
        return {
            "format": SUMMARY_FORMAT,
            "scenario": self.scenario,
            "seed": self.arenas[0].seed if one else [arena.seed for arena in self.arenas],
            "arenas": len(self.arenas),
            "robots": self.robots,
            "engine": self.engine,
            "runners": self.runners,
            "mode": self.mode,
            "ended": self.ended,
            "error": self.error,
            "ticks": self.ticks,
            "sim_time_s": self.sim_time_s,
            "wall_time_s": self.wall_time_s,
            "start_time_s": self.start_time_s,
            "realtime_factor": self.realtime_factor,
            "stop": list(self.stop),
            "by_arena": [arena.end() for arena in self.arenas],
            "trajectory_sha256": self.trajectory_sha256,
            "radio": radios[0] if one else radios,
            "metrics": metrics[0] if one else metrics,
            "events": events,
            "global_sensors": self.global_sensors,
            "counts": self.counts,
            "lost_runners": list(self.lost_runners),
            "runner_events": [asdict(change) for change in self.runner_events],
            "realtime": asdict(self.realtime) if self.realtime else None,
            "gateways": self.gateways,
            "record": self.record,
            "cpu": self.cpu,
            "versions": self.versions,
            "modules": self.modules,
            "files": [asdict(file) for file in self.files],
            "inputs": asdict(self.inputs) if self.inputs else None,
            "live_events": asdict(self.live_events) if self.live_events else None,
        }

    def write(self, path: Path) -> None:
        """Write `summary.json`."""
        write_text(path, json.dumps(self.summary(), indent=2) + "\n")


def arena_result(
    seed: int,
    ended: str,
    ticks: int,
    sim_time_s: float,
    sha256: str,
    counts: dict[str, int],
    radio: dict[str, Any] | None,
    metrics: dict[str, Any],
    stop: dict[str, Any],
) -> ArenaResult:
    """The parts of the observers' summaries that belong to one arena, typed."""
    of_radio = None if radio is None else _radio_result(**radio)
    of_metrics = {name: Statistics(**value) for name, value in metrics.items()}
    return ArenaResult(seed, ended, ticks, sim_time_s, sha256, counts, of_radio, of_metrics, **stop)


def _radio_result(latency_air_s: dict[str, Any], latency_agent_s: dict[str, Any], **counts: Any) -> RadioResult:
    air, agent = Percentiles(**latency_air_s), Percentiles(**latency_agent_s)
    return RadioResult(**counts, latency_air_s=air, latency_agent_s=agent)
