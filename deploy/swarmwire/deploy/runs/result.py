"""The result of a run: the summary as typed values."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from swarmwire.comms.base.clock import tick_start_ns, to_s
from swarmwire.comms.observe.truth import Static
from swarmwire.deploy.runs.backends import real_time_report
from swarmwire.deploy.runs.phases import Run
from swarmwire.deploy.runs.plan import Plan
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.runs.record.inputs import InputsRecord
from swarmwire.deploy.runs.record.provenance import RunFacts
from swarmwire.deploy.runs.record.replay_logs import LiveEventsRecord
from swarmwire.metrics.records.run_folder.layout import SUMMARY_FORMAT
from swarmwire.metrics.records.run_folder.tables import record_summary
from swarmwire.world.backends.realtime_backend import RealTimeReport
from swarmwire.world.backends.runner_reports import RunnerEvent
from swarmwire.world.gateways.ros2.relay_report import RelayReport
from swarmwire.world.interfaces.frame_ports import InterfacesReport
from swarmwire.world.loop import Loop
from swarmwire.world.motion.live import PosesReport
from swarmwire.world.world import World

NO_STOP = {"stop_time_s": None, "stopped_by": None}


@dataclass(frozen=True)
class Statistics:
    """Statistics of a metric over the ticks of a run; None for a metric without values."""

    final: float | None
    mean: float | None
    min: float | None
    max: float | None


@dataclass(frozen=True)
class Percentiles:
    """Percentiles in s; None without received packets."""

    p50: float | None
    p90: float | None
    p99: float | None


@dataclass(frozen=True)
class RadioResult:
    """The fates of all packets of one arena."""

    sent: int  #: number of packets
    intended: int  #: number of intended receivers, of all packets
    in_range: int  #: number of intended receivers in range
    fates: dict[str, int]  #: number of intended receivers by fate; the sum is `intended`
    pdr: float | None  #: packet delivery ratio: received / intended; None without intended receivers
    link_pdr: float | None  #: PDR of links: received / in_range; None if no receiver was in range
    latency_air_s: Percentiles  #: time from sending to reception
    latency_agent_s: Percentiles  #: time from sending to the tick at which the receiver can act


@dataclass(frozen=True)
class ArenaResult:
    """The results of one arena."""

    seed: int
    ended: str  #: "stopped" if it ended before the run; else as in `Result.ended`
    ticks: int  #: number of its ticks
    sim_time_s: float
    trajectory_sha256: str
    counts: dict[str, int]  #: its part of the run's counts, by name, without zeros
    radio: RadioResult | None
    metrics: dict[str, Statistics]
    stop_time_s: float | None  #: start of the time for which its stop condition held; None: censored at sim_time_s
    stopped_by: str | None  #: its stop condition in words: "order at least 0.9 for 5 s"

    def end(self) -> dict[str, Any]:
        """Return the fields about its end, as in the summary."""
        names = ("ended", "ticks", "sim_time_s", "stop_time_s", "stopped_by", "counts")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class EventResult:
    """An event that took effect, or ended after its time."""

    at_s: float  #: time in the scenario; for an event of single robots the tick's start
    tick: int
    do: str
    part: str  #: the part that fails; "" for other actions
    ended: bool
    singly: bool  #: True if each robot has a time of its own: batteries that run down, failures at a rate
    robots: list[list[str]]  #: names of the changed robots, per arena


@dataclass(frozen=True)
class Result:
    """The result of one run, with the content of `summary.json`."""

    scenario: str
    robots: int  #: number in each arena
    engine: str  #: engine of the bodies: "discs", "pymunk", "kinematic", or two of them joined by " and "
    runners: int  #: 0: all agents in the world's process
    mode: str  #: "local" | "lockstep" | "realtime"
    ended: str  #: "duration" | "stopped" (all arenas) | "interrupted" | "left" (by the caller, or a runner) | "failed"
    error: str | None  #: message of a failed run
    ticks: int  #: number of ticks of the longest arena
    sim_time_s: float
    wall_time_s: float  #: wall time of the loop
    start_time_s: float  #: wall time from the call to the first tick
    stop: tuple[str, ...]  #: stop conditions in words: "order at least 0.9 for 5 s"
    arenas: tuple[ArenaResult, ...]
    events: tuple[EventResult, ...]
    global_sensors: dict[str, list[str]]  #: sensors that measure beyond the robot's surroundings, by body
    counts: dict[str, int]  #: faults, by name: late, missing, malformed, clipped
    lost_runners: tuple[str, ...]  #: losses that the run survived: name, robots and reason
    runner_events: tuple[RunnerEvent, ...]  #: runners that joined, left, were lost and returned, in order
    realtime: RealTimeReport | None
    interfaces: InterfacesReport | None  #: report on the robots' network interfaces
    poses: tuple[PosesReport, ...]  #: reports on the live sources of poses
    relay: tuple[RelayReport, ...]  #: reports on the relayed topics of ROS 2
    facts: RunFacts
    inputs: InputsRecord | None  #: recorded external actions
    live_events: LiveEventsRecord | None  #: recorded live events
    record: dict[str, dict[str, Any]] = field(compare=False)  #: tables
    out: Path | None = field(compare=False)  #: the run folder

    @property
    def realtime_factor(self) -> float:
        """Simulated s per s of wall time of the loop."""
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
        """Return the content of `summary.json`; with several arenas, values that differ have one item per arena."""
        radios = [asdict(arena.radio) if arena.radio else None for arena in self.arenas]
        metrics = [{name: asdict(value) for name, value in arena.metrics.items()} for arena in self.arenas]
        is_single = len(self.arenas) == 1
        events = [{**asdict(event), "robots": event.robots[0] if is_single else event.robots} for event in self.events]
        return {
            "format": SUMMARY_FORMAT,
            "scenario": self.scenario,
            "seed": self.arenas[0].seed if is_single else [arena.seed for arena in self.arenas],
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
            "radio": radios[0] if is_single else radios,
            "metrics": metrics[0] if is_single else metrics,
            "events": events,
            "global_sensors": self.global_sensors,
            "counts": self.counts,
            "lost_runners": list(self.lost_runners),
            "runner_events": [asdict(change) for change in self.runner_events],
            "realtime": asdict(self.realtime) if self.realtime else None,
            "interfaces": asdict(self.interfaces) if self.interfaces else None,
            "poses": [asdict(report) for report in self.poses],
            "relay": [asdict(report) for report in self.relay],
            "gateways": dict(self.facts.gateways),
            "record": self.record,
            "cpu": self.facts.cpu,
            "versions": dict(self.facts.versions),
            "modules": dict(self.facts.modules),
            "files": [asdict(file) for file in self.facts.files],
            "inputs": asdict(self.inputs) if self.inputs else None,
            "live_events": asdict(self.live_events) if self.live_events else None,
        }


@dataclass(frozen=True)
class Outcome:
    """The end of a run, and its wall times."""

    ended: str  # one of the values of `Result.ended`
    error: str | None
    wall_ns: int  # wall time of the loop, without pauses
    start_ns: int  # wall time from the call to the first tick


def result_of(
    run: Run, plan: Plan, world: World, writer: RunWriter, entries: Mapping[str, Any], outcome: Outcome
) -> Result:
    """Return the result of a run that is over; `entries` are the observers' entries of the summary."""
    static, loop, facts, realtime = plan.static, run.loop, run.facts, real_time_report(run.backend)
    record = record_summary(entries)
    dropped = {f"rows_dropped_{table}": report["dropped"] for table, report in record.items() if report["dropped"]}
    runners = max(facts.runners, len({event.runner.partition("/")[0] for event in run.log.events}))
    return Result(
        scenario=static.name,
        robots=static.robots,
        runners=runners,
        engine=" and ".join(world.engines),
        mode="realtime" if realtime else "lockstep" if runners else "local",
        ended=outcome.ended,
        error=outcome.error,
        ticks=loop.ticks_done,
        sim_time_s=to_s(tick_start_ns(loop.ticks_done, static.rate_hz)),
        wall_time_s=to_s(outcome.wall_ns),
        start_time_s=to_s(outcome.start_ns),
        stop=tuple(entries.get("stop", ())),
        arenas=_arenas(loop, world, entries, outcome.ended),
        events=tuple(EventResult(**event) for event in entries["events"]),
        global_sensors=_global_sensors(static),
        counts={**loop.counts(), **run.observers.failures(), **dropped},
        lost_runners=tuple(str(loss) for loss in run.log.losses),
        runner_events=tuple(run.log.events),
        realtime=realtime,
        interfaces=entries.get("interfaces"),
        poses=tuple(source.report() for source in run.pose_sources),
        relay=run.ros_radio.report() if run.ros_radio else (),
        facts=facts,
        inputs=writer.inputs(),
        live_events=writer.live_events(),
        record=record,
        out=writer.path,
    )


def _arenas(loop: Loop, world: World, entries: Mapping[str, Any], ended: str) -> tuple[ArenaResult, ...]:
    static = world.static
    nothing = [None] * static.arenas
    columns = zip(
        static.seeds,
        world.running.tolist(),
        loop.arena_ticks.tolist(),
        loop.hexdigests(),
        loop.arena_counts(),
        entries.get("radio", nothing),
        entries["metrics"],
        entries.get("stops", nothing),
        strict=True,
    )
    return tuple(
        ArenaResult(
            seed=seed,
            ended=ended if running else "stopped",
            ticks=ticks,
            sim_time_s=to_s(tick_start_ns(ticks, static.rate_hz)),
            trajectory_sha256=sha256,
            counts=counts,
            radio=None if radio is None else _radio_result(**radio),
            metrics={name: Statistics(**value) for name, value in metrics.items()},
            **(stop or NO_STOP),
        )
        for seed, running, ticks, sha256, counts, radio, metrics, stop in columns
    )


def _radio_result(latency_air_s: dict[str, Any], latency_agent_s: dict[str, Any], **counts: Any) -> RadioResult:
    air, agent = Percentiles(**latency_air_s), Percentiles(**latency_agent_s)
    return RadioResult(**counts, latency_air_s=air, latency_agent_s=agent)


def _global_sensors(static: Static) -> dict[str, list[str]]:
    sensors: dict[str, list[str]] = {}
    for body in (group.body for group in static.groups):  # bodies of one name, from users' sheets, share an entry
        names = sensors.setdefault(body.name, [])
        names += [name for name, sheet in body.sensors.items() if sheet.is_global and name not in names]
    return {body: names for body, names in sensors.items() if names}
