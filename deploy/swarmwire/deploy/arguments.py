"""What people ask of an execution, checked at the door: seeds, runners, the pace of real time."""

from collections.abc import Sequence
from pathlib import Path

from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario

FASTEST = 1e6  # factor in real time
MIN_SUBTICK_S = 0.001
LARGEST_SEED = 2**63 - 1
MAX_SEEDS = 1_000_000
MAX_ARENAS = 10_000  # of one world
SEEDS = "how many (9: 1 to 9), FIRST:END (4:10: 4 to 9), or a list (1,5,7; 9, for 9 alone)"
Runners = int | str | None  # how many, "per-robot", or None for a local backend
SeedsGiven = str | int | Sequence[int]  # how many from 1 on, as a number or text; a range or list as text; a list


def seed_list(given: SeedsGiven, said: str = "--seeds") -> tuple[int, ...]:
    """The seeds that are meant, here as everywhere; BadInput names `said` unless they are different and 0 or more."""
    try:
        seeds = _seeds_in(given) if isinstance(given, str | int) else list(given)
    except ValueError:
        raise BadInput(said, "", f"expected {SEEDS}; got {given!r}") from None
    if not 0 < len(seeds) <= MAX_SEEDS:
        raise BadInput(said, "", f"expected {SEEDS}, 1 to {MAX_SEEDS} of them; got {given!r}")
    good = all(type(seed) is int and 0 <= seed <= LARGEST_SEED for seed in (seeds[0], *seeds))
    if not good or (not isinstance(seeds, range) and len(set(seeds)) < len(seeds)):
        raise BadInput(said, "", f"expected different whole numbers from 0 to {LARGEST_SEED}; got {given!r}")
    return tuple(seeds)


def _seeds_in(given: str | int) -> range | list[int]:
    """Unchecked; of a range that is too long its start, with one seed too many."""
    if isinstance(given, int) or given.strip().isdecimal():
        return range(1, min(int(given), MAX_SEEDS + 1) + 1)
    first, colon, end = given.partition(":")
    if colon:
        return range(int(first), min(int(end), int(first) + MAX_SEEDS + 1))
    return [int(part) for part in given.split(",") if part.strip()]


def choose_seeds(scenario: Scenario, seed: int | None, seeds: SeedsGiven | None) -> tuple[int, ...]:
    """The seed of each arena: those asked for, or the scenario's own; BadInput if they are no good."""
    if seeds is None:
        alone = scenario.seed if seed is None else seed
        if not 0 <= alone <= LARGEST_SEED:
            raise BadInput("--seed", "", f"expected a whole number from 0 to {LARGEST_SEED}, got {alone}")
        return (alone,)
    if seed is not None:
        raise BadInput("--seed", "", "expected only one of --seed and --seeds")
    chosen = seed_list(seeds)
    if len(chosen) > MAX_ARENAS:
        most = f"at most {MAX_ARENAS} seeds side by side; sweep takes more"
        raise BadInput("--seeds", "", f"expected {most}; got {len(chosen)}")
    return chosen


def runner_count(runners: Runners, robots: int) -> int:
    """How many runners there will be, 0 for a local backend; BadInput if there are not so many robots."""
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


def subtick_of(subtick: float | None, factor: float | None, scenario: Scenario) -> float | None:
    """The subtick of a run in real time at so many times the wall clock's pace, in s; BadInput if it cannot be."""
    if subtick is None:
        return None
    if factor is None:
        raise BadInput("--subtick", "", "expected --realtime with it, or gateways: without them no clock paces the run")
    if scenario.radio is None:
        raise BadInput("--subtick", "", "expected a scenario with a radio: without one nothing happens between ticks")
    tick_s = 1 / scenario.time.rate_hz / factor
    if not MIN_SUBTICK_S <= subtick <= tick_s:
        expected = f"expected {MIN_SUBTICK_S:g} s to a tick's {tick_s:g} s of wall time, got {subtick!r}"
        raise BadInput("--subtick", "", expected)
    return subtick


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
