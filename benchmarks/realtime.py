"""Real time with a subtick: how late packets are handed over, and how late ticks begin."""

import os
import statistics

from benchmarks import scenes
from benchmarks.lines import report, spread
from swarmwire.deploy import run
from swarmwire.world.backends.pacing import LatencySummary
from swarmwire.world.scenario_file import scenario_from

AGENT = "benchmarks.agents:Relay"
MS_PER_S = 1000.0


def realtime(name: str, repeats: int, *, robots: int, runners: int, subtick_s: float, duration_s: float) -> None:
    """Actual minus modelled delivery and tick jitter of robots that relay; p99 in ms, the rest beside it."""
    mapping = scenes.flocking(robots, duration_s)
    mapping["robots"]["flock"]["agent"] = AGENT
    mapping["radio"] |= {"latency_s": 0.005, "jitter_s": 0.002}
    scenario = scenario_from(mapping, name)
    run(scenario.model_copy(update={"duration_s": 1.0}))
    results = [run(scenario, runners=runners, realtime=1.0, subtick=subtick_s) for _ in range(repeats)]
    timings = [result.realtime for result in results if result.realtime]
    delivery = [_ms(timing.delivery) for timing in timings]
    jitter = [_ms(timing.tick_jitter) for timing in timings]
    for row_name, values, last in (
        (name, delivery, timings[-1].delivery),
        (f"{name}-jitter", jitter, timings[-1].tick_jitter),
    ):
        config = {
            "agent": AGENT,
            "subtick_s": subtick_s,
            "radio": mapping["radio"],
            "p50_ms": round(last.p50_s * MS_PER_S, 3) if last else None,
            "worst_ms": round(last.worst_s * MS_PER_S, 3) if last else None,
            "counted": last.count if last else 0,
            "missed_ticks": timings[-1].missed_ticks,
            "load_average": round(os.getloadavg()[0], 1),  # a p99 of a millisecond is one of a quiet machine
            **spread(values),
        }
        report(row_name, statistics.median(values), "ms", results[-1], config)


def _ms(delays: LatencySummary | None) -> float:
    return delays.p99_s * MS_PER_S if delays else float("nan")
