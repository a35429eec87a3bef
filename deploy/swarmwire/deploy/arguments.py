"""What people ask of an execution, checked at the door: seeds, runners, the pace of real time."""

from collections.abc import Sequence
from pathlib import Path

from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.scenario_file import load_scenario

FASTEST = 1e6  # factor in real time
SHORTEST_QUANTUM_S = 0.001
Runners = int | str | None  # how many, "per-robot", or None for a local crew


def choose_seeds(scenario: Scenario, seed: int | None, seeds: Sequence[int] | None) -> tuple[int, ...]:
    """The seed of each arena: those asked for, or the scenario's own; BadInput if they are no good."""
    if seed is not None and seeds is not None:
        raise BadInput("", "seed and seeds", "expected only one of the two")
    chosen = tuple(seeds) if seeds is not None else (scenario.seed if seed is None else seed,)
    if not chosen or len(set(chosen)) != len(chosen) or min(chosen) < 0:
        raise BadInput("", "seeds", f"expected different whole numbers of at least 0, got {list(chosen)}")
    return chosen


def runner_count(runners: Runners, robots: int) -> int:
    """How many runners there will be, 0 for a local crew; BadInput if there are not so many robots."""
    if runners is None or runners == "none":
        return 0
    if runners == "per-robot":
        return robots
    if isinstance(runners, str) and runners.isdecimal():
        runners = int(runners)
    if isinstance(runners, str | bool) or not 1 <= runners <= robots:
        raise BadInput("--runners", "", f'expected "none", "per-robot" or 1 to {robots} (the robots), got {runners!r}')
    return runners


def real_time_factor(realtime: float | str | None) -> float | None:
    """Simulated seconds per second of wall time, None for as fast as possible; BadInput if it is no such number."""
    if realtime is None:
        return None
    try:
        factor = float(realtime)
    except ValueError:
        factor = 0.0
    if not 0 < factor <= FASTEST:
        raise BadInput("--realtime", "", f"expected a factor above 0 and at most {FASTEST:g}, got {realtime!r}")
    return factor


def quantum_of(quantum: float | None, factor: float | None, scenario: Scenario) -> float | None:
    """The quantum of a run in real time at so many times the wall clock's pace, in s; BadInput if it cannot be."""
    if quantum is None:
        return None
    if factor is None:
        raise BadInput("--quantum", "", "expected --realtime with it, or gateways: without them no clock paces the run")
    if scenario.radio is None:
        raise BadInput("--quantum", "", "expected a scenario with a radio: without one nothing happens between ticks")
    tick_s = 1 / scenario.time.rate_hz / factor
    if not SHORTEST_QUANTUM_S <= quantum <= tick_s:
        expected = f"expected {SHORTEST_QUANTUM_S:g} s to a tick's {tick_s:g} s of wall time, got {quantum!r}"
        raise BadInput("--quantum", "", expected)
    return quantum


def scenario_of(given: Scenario | Path | str, overrides: Sequence[str]) -> Scenario:
    """The scenario as checked; BadInput for overrides of one that is complete as it is."""
    if not isinstance(given, Scenario):
        return load_scenario(given, overrides)
    if overrides:
        raise BadInput("overrides", "", "expected a path of a scenario; a Scenario is complete as it is")
    return given


def tick_count(scenario: Scenario) -> int:
    """Ticks that start before the scenario's duration is over; the first always does."""
    return max(1, -(-to_ns(scenario.duration_s) * scenario.time.rate_hz // 10**9))
