"""What a run is asked to be: `RunConfig`, its parts, and the checks of each value; BadInput names the option."""

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields
from pathlib import Path
from typing import TypedDict

from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.wire.access_control import RunAccess, agents_access, observers_access
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.limits import LIMITS, JoinLimits
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.runs.gateways.gateways import GatewaysGiven
from swarmwire.deploy.runs.record.inputs import RecordedInputs
from swarmwire.metrics.pictures.viewer.selection import selected_robot
from swarmwire.world.backends.join_policy import ListenSettings
from swarmwire.world.backends.registry import NON_BLOCKING
from swarmwire.world.backends.runner_reports import RunnerEvent
from swarmwire.world.live_events import LiveEvent
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario

MAX_FACTOR = 1e6  # in real time
MIN_SUBTICK_S = 0.001
LARGEST_SEED = 2**63 - 1
MAX_SEEDS = 1_000_000
MAX_ARENAS = 10_000  # of one world
SEEDS = "how many (9: 1 to 9), FIRST:END (4:10: 4 to 9), or a list (1,5,7; 9, for 9 alone)"
PACKETS = 'expected "off", "all" or a share from 0 to 1'
Runners = int | str | None  # how many, "per-robot", or None for a local backend
SeedsGiven = str | int | Sequence[int]  # how many from 1 on, as a number or text; a range or list as text; a list


@dataclass(frozen=True)
class Recording:
    """What to record. A run can be repeated (`swarmwire repeat`), with more recorded than the first time."""

    packets: float = 0.0  # share of the packets that go into `packets.parquet`, drawn by key; 1: all
    links: bool = False  # `radio_links.parquet`
    tables: bool = True  # `ticks.parquet`, `events.parquet`, `radio_robots.parquet`, `radio_distances.parquet`
    rrd: bool = True  # `run.rrd`, for rerun's viewer
    select: str | None = None  # the robot that views show in detail; None: the first that has rays or photocells

    def __post_init__(self) -> None:
        if not 0.0 <= self.packets <= 1.0:
            raise BadInput("--packets", "", f"{PACKETS}, got {self.packets!r}")
        if self.packets and not self.tables:
            raise BadInput("--packets", "", "expected no packets without tables")
        if self.links and not self.tables:
            raise BadInput("--links", "", "expected no links without tables")

    def check(self, static: Static) -> None:
        """BadInput unless the selected robot is one of the run's."""
        selected_robot(static, self.select, "--select")


class JoinObserver:
    """Gets the runners that join and leave a world that listens. Override the methods that are needed."""

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """The world listens, at these endpoints."""

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """A runner joined, left, was lost or returned; `free` are the robots without an agent now."""

    def refused(self, runner: str, why: str) -> None:
        """A runner was not admitted."""

    def waiting(self, free: tuple[str, ...]) -> None:
        """The run waits for agents of these robots."""


@dataclass(frozen=True)
class Listening:
    """Where a world listens for runners that others start."""

    endpoints: tuple[str, ...]  # such as "tls/0.0.0.0:7447"
    observed: tuple[str, ...] = ()  # where observers and operators from elsewhere meet it
    network: Network = field(default_factory=Network)  # the world's certificates
    access: RunAccess | None = None  # who may do what; None: each program that reaches an endpoint may join
    start_with: int | None = None  # robots with an agent that are enough for the first tick; None: all
    limits: JoinLimits = LIMITS  # what is taken from runners at most
    observer: JoinObserver = field(default_factory=JoinObserver)  # of runners that join and leave

    def check(self, scenario: Scenario, robots: int) -> None:
        """BadInput for endpoints that will not do, or a start that the scenario does not allow; `robots` in all."""
        for endpoint in self.endpoints:
            self.network.check_endpoint(endpoint, "", "--listen")
        for endpoint in self.observed:
            self.network.check_endpoint(endpoint, "", "--observe")
        if self.start_with is None:
            return
        if not 0 <= self.start_with <= robots:
            raise BadInput("--start-with", "", f"expected 0 to {robots} (the robots), got {self.start_with}")
        if self.start_with < robots and scenario.run.on_runner_loss not in NON_BLOCKING:
            expected = "expected stand or coast with --start-with, for robots without an agent"
            raise BadInput(scenario.source, "run.on_runner_loss", expected)

    def for_agents(self, run_id: str) -> ListenSettings:
        """Where runners meet the world."""
        access = None if self.access is None else agents_access(Keys(run_id), self.access)
        return ListenSettings(self.endpoints, self.network, access)

    def for_observers(self, run_id: str) -> ListenSettings:
        """Where observers meet the world."""
        access = None if self.access is None else observers_access(ObserverKeys(run_id), self.access)
        return ListenSettings(self.observed, self.network, access)


@dataclass(frozen=True)
class Replay:
    """What a repeated run takes from the record of the first."""

    ticks: int  # instead of the scenario's
    inputs: RecordedInputs | None  # None: all follows from scenario and seed
    live_events: tuple[LiveEvent, ...] = ()  # what people did to it
    subtick_s: float | None = None  # at which packets came in the middle of ticks; None: at their starts


@dataclass(frozen=True)
class RunConfig:
    """What a run is asked to be: the options of `swarmwire.deploy.run`, `Simulation` and `swarmwire run`."""

    scenario: Scenario | Path | str
    _: KW_ONLY
    seed: int | None = None  # of the only arena; None: the scenario's
    seeds: SeedsGiven | None = None  # one arena per seed, side by side: how many (9: 1 to 9), a list, or "4:10"
    threads: int = 1  # of this process for one tick; more change nothing but the speed
    runners: Runners = None  # None: all agents in this process; a number of runner processes; or "per-robot"
    agent_network: bool = False  # whether agents in processes of their own may use this machine's network
    isolate: bool = False  # whether these processes are closed also to code that is not trusted
    overrides: Sequence[str] = ()  # of the scenario: "path=value", as for `--set`
    out: Path | str | None = None  # the run folder, new or empty; None: nothing is written
    observers: Sequence[Observer] = ()  # one that raises is reported, counted and left out from then on
    realtime: float | str | None = None  # simulated s per s of wall time; None: as fast as the machine allows
    subtick: float | None = None  # in real time: s of wall time after which packets cross also between ticks
    record: Recording | None = None  # what goes into the run folder; None: as `Recording()`
    gateways: GatewaysGiven = None  # robots that answer as real ones: "epuck2", {"flock": "ros2"}, or `Gateways`
    listening: Listening | None = None  # for runners that others start, on this machine or elsewhere
    replay: Replay | None = None  # of a run that is repeated


class RunOptions(TypedDict, total=False):
    """The fields of `RunConfig` behind the scenario, as keywords of `run` and `Simulation`."""

    seed: int | None
    seeds: SeedsGiven | None
    threads: int
    runners: Runners
    agent_network: bool
    isolate: bool
    overrides: Sequence[str]
    out: Path | str | None
    observers: Sequence[Observer]
    realtime: float | str | None
    subtick: float | None
    record: Recording | None
    gateways: GatewaysGiven
    listening: Listening | None
    replay: Replay | None


def check_options(call: str, options: Iterable[str], config: type) -> None:
    """TypeError for a keyword of `call` that is no keyword field of the dataclass `config`."""
    known = [option.name for option in fields(config) if option.kw_only]
    for name in options:
        if name not in known:
            raise TypeError(f"{call}: unexpected keyword {name!r}; expected {did_you_mean(known, name)}")


def packet_share(text: str) -> float:
    """The share of packets that "off", "all" or a number asks for; BadInput for anything else."""
    try:
        return {"off": 0.0, "all": 1.0}[text] if text in ("off", "all") else float(text)
    except ValueError:
        raise BadInput("--packets", "", f"{PACKETS}, got {text!r}") from None


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
    if not 0 < factor <= MAX_FACTOR:
        raise BadInput("--realtime", "", f"expected a factor above 0 and at most {MAX_FACTOR:g}, got {realtime!r}")
    return factor


def subtick_of(subtick: float | None, factor: float | None, scenario: Scenario) -> float | None:
    """The subtick of a run in real time at so many times the wall clock's pace, in s; BadInput if it cannot be.

    With network interfaces there always is one.
    """
    if subtick is None and factor is not None and scenario.radio and scenario.radio.interface:
        subtick = MIN_SUBTICK_S
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
