"""The options of a run, `RunConfig`, and the checks of single values; BadInput names the field."""

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
from swarmwire.deploy.runs.gateways.gateways import GatewayOption
from swarmwire.deploy.runs.record.inputs import RecordedInputs
from swarmwire.metrics.pictures.viewer.selection import selected_robot
from swarmwire.world.backends.join_policy import ListenSettings
from swarmwire.world.backends.registry import NON_BLOCKING
from swarmwire.world.backends.runner_reports import RunnerEvent
from swarmwire.world.live_events import LiveEvent
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario

MAX_FACTOR = 1e6  # simulated s per s of wall time, in real time
MIN_SUBTICK_S = 0.001
MAX_SEED = 2**63 - 1
MAX_SEEDS = 1_000_000
MAX_ARENAS = 10_000  # arenas of one world
SEEDS = "a number of seeds (9: 1 to 9), FIRST:END (4:10: 4 to 9), or a list (1,5,7; 9, for 9 alone)"
PACKETS = 'expected "off", "all" or a share from 0 to 1'
Runners = int | str | None  # number of runners, "per-robot", or None: all agents in this process
SeedsOption = str | int | Sequence[int]  # number of seeds from 1 on; a number, range or list as text; a list


@dataclass(frozen=True)
class Recording:
    """The records of a run. A run can be repeated (`swarmwire repeat`) with more records than the first time."""

    packets: float = 0.0  #: share of the packets in `packets.parquet`, drawn by key; 1: all
    links: bool = False  #: `radio_links.parquet`
    tables: bool = True  #: `ticks.parquet`, `events.parquet`, `radio_robots.parquet`, `radio_distances.parquet`
    rrd: bool = True  #: `run.rrd`, for rerun's viewer, where the extra `view` is installed
    select: str | None = None  #: robot that views show in detail; None: the first that has rays or photocells

    def __post_init__(self) -> None:
        if not 0.0 <= self.packets <= 1.0:
            raise BadInput("packets", "", f"{PACKETS}, got {self.packets!r}")
        if self.packets and not self.tables:
            raise BadInput("packets", "", "expected no packets without tables")
        if self.links and not self.tables:
            raise BadInput("links", "", "expected no links without tables")

    def check(self, static: Static) -> None:
        """Raise BadInput unless the selected robot is one of the run's."""
        selected_robot(static, self.select, "select")


class JoinObserver:
    """Receives the events of runners that join and leave an open run. Subclasses override the methods they need."""

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        """Handle the start of listening at these endpoints."""

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        """Handle a runner that joined, left, was lost or returned; `free` are the robots without an agent now."""

    def refused(self, runner: str, reason: str) -> None:
        """Handle a runner that was not admitted."""

    def waiting(self, free: tuple[str, ...]) -> None:
        """Handle the start of a wait for agents of these robots."""


@dataclass(frozen=True)
class Listening:
    """The endpoints of a run with remote agents, and the terms on which runners join."""

    endpoints: tuple[str, ...]  #: endpoints for runners, such as "tls/0.0.0.0:7447"
    observed: tuple[str, ...] = ()  #: endpoints for remote observers and operators
    network: Network = field(default_factory=Network)  #: certificates of the run
    access: RunAccess | None = None  #: names with permissions; None: each program that reaches an endpoint may join
    start_with: int | None = None  #: number of robots with an agent at which the first tick begins; None: all
    limits: JoinLimits = LIMITS
    observer: JoinObserver = field(default_factory=JoinObserver)

    def check(self, scenario: Scenario, robots: int) -> None:
        """Raise BadInput for an unsafe endpoint, or a start that the scenario does not allow, with `robots` in all."""
        for endpoint in self.endpoints:
            self.network.check_endpoint(endpoint, "endpoints", "")
        for endpoint in self.observed:
            self.network.check_endpoint(endpoint, "observed", "")
        if self.start_with is None:
            return
        if not 0 <= self.start_with <= robots:
            raise BadInput("start_with", "", f"expected 0 to {robots} (the robots), got {self.start_with}")
        if self.start_with < robots and scenario.run.on_runner_loss not in NON_BLOCKING:
            expected = "expected stand or coast with start_with, for robots without an agent"
            raise BadInput(scenario.source, "run.on_runner_loss", expected)

    def for_agents(self, run_id: str) -> ListenSettings:
        """Return the settings of the session for runners."""
        access = None if self.access is None else agents_access(Keys(run_id), self.access)
        return ListenSettings(self.endpoints, self.network, access)

    def for_observers(self, run_id: str) -> ListenSettings:
        """Return the settings of the session for observers."""
        access = None if self.access is None else observers_access(ObserverKeys(run_id), self.access)
        return ListenSettings(self.observed, self.network, access)


@dataclass(frozen=True)
class Replay:
    """The parts of a run's record that determine its repetition."""

    ticks: int  #: instead of the scenario's
    inputs: RecordedInputs | None  #: None: all actions follow from scenario and seed
    live_events: tuple[LiveEvent, ...] = ()
    subtick_s: float | None = None  #: interval at which packets crossed between ticks; None: at the starts of ticks


@dataclass(frozen=True)
class RunConfig:
    """The options of a run, as of `swarmwire.deploy.run`, `Simulation` and `swarmwire run`."""

    scenario: Scenario | Path | str
    _: KW_ONLY
    seed: int | None = None  #: seed of the only arena; None: the scenario's
    seeds: SeedsOption | None = None  #: one arena per seed, side by side: a number (9: 1 to 9), a list, or "4:10"
    threads: int = 1  #: threads of this process for one tick; they change nothing but the speed
    runners: Runners = None  #: None: all agents in this process; a number of runner processes; or "per-robot"
    agent_network: bool = False  #: True: agents in processes of their own may use this machine's network
    isolate: bool = False  #: True: these processes are isolated, for code that is not trusted
    overrides: Sequence[str] = ()  #: values of the scenario, "path=value", like `--set`
    out: Path | str | None = None  #: run folder, new or empty; None: nothing is written
    observers: Sequence[Observer] = ()  #: an observer that raises is reported, counted and left out
    realtime: float | str | None = None  #: simulated s per s of wall time; None: as fast as the machine allows
    subtick: float | None = None  #: wall time in s after which packets cross also between ticks, in real time
    record: Recording | None = None  #: records in the run folder; None: `Recording()`
    gateways: GatewayOption = None  #: robots that answer as real ones: "epuck2", {"flock": "ros2"}, or `Gateways`
    listening: Listening | None = None  #: endpoints for runners that others start, here or elsewhere
    replay: Replay | None = None  #: record of the run that is repeated


class RunOptions(TypedDict, total=False):
    """The fields of `RunConfig` after the scenario, as keywords of `run` and `Simulation`."""

    seed: int | None
    seeds: SeedsOption | None
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
    gateways: GatewayOption
    listening: Listening | None
    replay: Replay | None


def check_options(call: str, options: Iterable[str], config: type) -> None:
    """Raise TypeError for a keyword of `call` that is no keyword field of the dataclass `config`."""
    names = [option.name for option in fields(config) if option.kw_only]
    for name in options:
        if name not in names:
            raise TypeError(f"{call}: unexpected keyword {name!r}; expected {did_you_mean(names, name)}")


def packet_share(text: str) -> float:
    """Parse a share of packets: "off", "all" or a number; BadInput for any other text."""
    try:
        return {"off": 0.0, "all": 1.0}[text] if text in ("off", "all") else float(text)
    except ValueError:
        raise BadInput("packets", "", f"{PACKETS}, got {text!r}") from None


def seed_list(seeds: SeedsOption, field_name: str = "seeds") -> tuple[int, ...]:
    """Return the seeds; BadInput names `field_name` unless they are different and 0 or more."""
    try:
        values = _parse_seeds(seeds) if isinstance(seeds, str | int) else list(seeds)
    except ValueError:
        raise BadInput(field_name, "", f"expected {SEEDS}; got {seeds!r}") from None
    if not 0 < len(values) <= MAX_SEEDS:
        raise BadInput(field_name, "", f"expected {SEEDS}, 1 to {MAX_SEEDS} of them; got {seeds!r}")
    are_valid = all(type(seed) is int and 0 <= seed <= MAX_SEED for seed in (values[0], *values))
    if not are_valid or (not isinstance(values, range) and len(set(values)) < len(values)):
        raise BadInput(field_name, "", f"expected different whole numbers from 0 to {MAX_SEED}; got {seeds!r}")
    return tuple(values)


def _parse_seeds(seeds: str | int) -> range | list[int]:
    """Return unchecked seeds; a range that is too long is cut after one seed too many."""
    if isinstance(seeds, int) or seeds.strip().isdecimal():
        return range(1, min(int(seeds), MAX_SEEDS + 1) + 1)
    first, colon, end = seeds.partition(":")
    if colon:
        return range(int(first), min(int(end), int(first) + MAX_SEEDS + 1))
    return [int(part) for part in seeds.split(",") if part.strip()]


def choose_seeds(scenario: Scenario, seed: int | None, seeds: SeedsOption | None) -> tuple[int, ...]:
    """Return the seed of each arena: those of the options, or the scenario's; BadInput for invalid seeds."""
    if seeds is None:
        single = scenario.seed if seed is None else seed
        if not 0 <= single <= MAX_SEED:
            raise BadInput("seed", "", f"expected a whole number from 0 to {MAX_SEED}, got {single}")
        return (single,)
    if seed is not None:
        raise BadInput("seed", "", "expected only one of seed and seeds")
    values = seed_list(seeds)
    if len(values) > MAX_ARENAS:
        expected = f"expected at most {MAX_ARENAS} seeds side by side; sweep takes more"
        raise BadInput("seeds", "", f"{expected}; got {len(values)}")
    return values


def runner_count(runners: Runners, robots: int) -> int:
    """Return the number of runners, 0 for agents in this process; BadInput for more runners than robots."""
    if runners is None or runners == "none":
        return 0
    if runners == "per-robot":
        return robots
    if isinstance(runners, str) and runners.isdecimal():
        runners = int(runners)
    if isinstance(runners, str | bool) or not 1 <= runners <= robots:
        raise BadInput("runners", "", f'expected "none", "per-robot" or 1 to {robots} (the robots), got {runners!r}')
    return runners


def parse_factor(realtime: float | str | None) -> float | None:
    """Return simulated s per s of wall time, None for as fast as possible; BadInput for an invalid number."""
    if realtime is None:
        return None
    try:
        factor = float(realtime)
    except ValueError:
        factor = 0.0
    if not 0 < factor <= MAX_FACTOR:
        raise BadInput("realtime", "", f"expected a factor above 0 and at most {MAX_FACTOR:g}, got {realtime!r}")
    return factor


def checked_subtick(
    subtick: float | None, factor: float | None, scenario: Scenario, has_crazyradio: bool
) -> float | None:
    """Return the sub-tick of a run in s of wall time.

    A real-time run with network interfaces, or with Crazyflies whose clients' packets cross the radio, always has one.
    `factor` is the real-time factor. BadInput for a sub-tick without real time or radio, or out of bounds.
    """
    needs_subticks = has_crazyradio or (scenario.radio is not None and scenario.radio.interface is not None)
    if subtick is None and factor is not None and needs_subticks:
        subtick = MIN_SUBTICK_S
    if subtick is None:
        return None
    if scenario.radio and scenario.radio.positions == "interpolated":
        expected = 'expected "held" with sub-ticks: packets cross before the positions at the end of a tick are known'
        raise BadInput(scenario.source, "radio.positions", expected)
    if factor is None:
        raise BadInput("subtick", "", "expected realtime with it, or gateways: without them no clock paces the run")
    if scenario.radio is None:
        raise BadInput("subtick", "", "expected a scenario with a radio: without one nothing happens between ticks")
    tick_s = 1 / scenario.time.rate_hz / factor
    if not MIN_SUBTICK_S <= subtick <= tick_s:
        expected = f"expected {MIN_SUBTICK_S:g} s to a tick's {tick_s:g} s of wall time, got {subtick!r}"
        raise BadInput("subtick", "", expected)
    return subtick


def checked_scenario(scenario: Scenario | Path | str, overrides: Sequence[str]) -> Scenario:
    """Return the checked scenario; BadInput for overrides of a `Scenario`, which is complete."""
    if not isinstance(scenario, Scenario):
        return load_scenario(scenario, overrides)
    if overrides:
        raise BadInput("overrides", "", "expected a path of a scenario; a Scenario is complete as it is")
    return scenario


def tick_count(scenario: Scenario) -> int:
    """Return the number of ticks that start within the scenario's duration, at least 1."""
    return max(1, -(-to_ns(scenario.duration_s) * scenario.time.rate_hz // 10**9))
