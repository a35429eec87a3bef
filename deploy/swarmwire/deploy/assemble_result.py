"""From what a run left in loop, observers and backend to its result."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from swarmwire.comms.clock import tick_start_ns, to_s
from swarmwire.comms.truth import Static
from swarmwire.deploy.record.inputs import InputsRecord
from swarmwire.deploy.record.live_events import LiveEventsRecord
from swarmwire.deploy.record.origin import Origin
from swarmwire.deploy.result import EventResult, Result, arena_result
from swarmwire.metrics.run_folder.tables import record_summary
from swarmwire.world.backends.realtime_backend import RealTimeReport
from swarmwire.world.backends.registry import Loss, RunnerEvent

NO_STOP = {"stop_time_s": None, "stopped_by": None}


def assemble_result(
    static: Static,
    parts: Mapping[str, Any],
    *,
    ended: str,
    error: BaseException | None,
    runners: int,
    ticks: int,
    arena_ticks: Sequence[int],
    stopped: Sequence[bool],
    hashes: Sequence[str],
    wall_s: float,
    start_s: float,
    counts: Mapping[str, int],
    arena_counts: Sequence[dict[str, int]],
    origin: Origin,
    inputs: InputsRecord | None,
    live_events: LiveEventsRecord | None,
    losses: Sequence[Loss],
    changes: Sequence[RunnerEvent],
    engines: Sequence[str],
    realtime: RealTimeReport | None,
    folder: Path | None,
) -> Result:
    """The result; `parts` are the observers' parts of the summary.

    `arena_ticks`, `stopped` (it was over before the run was), `hashes` (of the trajectory) and `arena_counts` are those
    of each arena.
    """
    radios: list[Any] = parts.get("radio", [None] * static.arenas)
    ends = ["stopped" if over else ended for over in stopped]
    times_s = [to_s(tick_start_ns(done, static.rate_hz)) for done in arena_ticks]
    stops: list[Any] = parts.get("stops", [NO_STOP] * static.arenas)
    columns = static.seeds, ends, arena_ticks, times_s, hashes, arena_counts, radios, parts["metrics"], stops
    arenas = zip(*columns, strict=True)
    record = record_summary(parts)
    return Result(
        scenario=static.name,
        robots=static.robots,
        runners=runners,
        engine=" and ".join(engines),
        mode="realtime" if realtime else "lockstep" if runners else "local",
        ended=ended,
        error=str(error) if ended == "failed" else None,
        ticks=ticks,
        sim_time_s=to_s(tick_start_ns(ticks, static.rate_hz)),
        wall_time_s=wall_s,
        start_time_s=start_s,
        stop=tuple(parts.get("stop", ())),
        arenas=tuple(arena_result(*arena) for arena in arenas),
        events=tuple(EventResult(**event) for event in parts["events"]),
        global_sensors=_global_sensors(static),
        counts={**counts, **_dropped_rows(record)},
        cpu=origin.cpu,
        versions=dict(origin.versions),
        modules=dict(origin.modules),
        files=origin.files,
        inputs=inputs,
        live_events=live_events,
        lost_runners=tuple(str(loss) for loss in losses),
        runner_events=tuple(changes),
        realtime=realtime,
        gateways=dict(origin.gateways),
        record=record,
        out=folder,
    )


def _global_sensors(static: Static) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for body in (group.body for group in static.groups):  # two of one name, by sheets of users' own, are told together
        own = found.setdefault(body.name, [])
        own += [name for name, sheet in body.sensors.items() if sheet.is_global and name not in own]
    return {body: sensors for body, sensors in found.items() if sensors}


def _dropped_rows(record: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Rows that a slow disk cost, by name, as they are counted in the summary."""
    return {f"rows_dropped_{table}": of["dropped"] for table, of in record.items() if of["dropped"]}
