"""The live sources of a run's poses: checked with the plan, open as long as the run."""

from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from math import inf

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.world.motion.live import LiveSource
from swarmwire.world.motion.mavlink import MavlinkSource
from swarmwire.world.motion.ros2 import Ros2Source
from swarmwire.world.motion.tracker import TrackerSource
from swarmwire.world.motion.udp import UdpSource
from swarmwire.world.scenario.motion import LiveMotion, MavlinkMotion, Ros2Motion, TrackerMotion, UdpMotion
from swarmwire.world.scenario.scenario import Scenario

SOURCES: dict[type[LiveMotion], type[LiveSource]] = {
    UdpMotion: UdpSource,
    MavlinkMotion: MavlinkSource,
    TrackerMotion: TrackerSource,
    Ros2Motion: Ros2Source,
}


def check_live_sources(scenario: Scenario, static: Static, *, in_real_time: bool) -> None:
    """Raise BadInput for a live source in a run as fast as possible, or with several seeds."""
    for group, motion in scenario.live_motions().items():
        key = f"robots.{group}.motion.source"
        if not in_real_time:
            expected = f"expected a run in real time (--realtime): poses of {motion.source} arrive as time passes"
            raise BadInput(scenario.source, key, expected)
        if static.arenas > 1:
            raise BadInput(scenario.source, key, f"expected one seed: poses arrive for one arena, got {static.arenas}")


@contextmanager
def open_sources(
    scenario: Scenario, static: Static, clock: Clock, report: Callable[[str], None]
) -> Generator[tuple[LiveSource, ...]]:
    """Receive the poses of all live sources within the context; BadInput for an address that cannot be used."""
    with ExitStack() as stack:
        sources: list[LiveSource] = []
        for group in static.groups:
            motion = scenario.robots[group.name].motion
            if not isinstance(motion, LiveMotion):
                continue
            rows, half_m = range(group.start, group.stop), (0.5 * static.arena_size_m[0], 0.5 * static.arena_size_m[1])
            names = static.robot_names[group.start : group.stop]
            source = SOURCES[type(motion)](motion, names, rows, half_m if static.walled else (inf, inf), clock)
            _open(source, f"robots.{group.name}.motion", scenario.source)
            stack.callback(source.close)
            exposed = " (from any machine that reaches it)" if source.is_exposed else ""
            report(f"poses of {group.name}: {source.address}{exposed}")
            sources.append(source)
        yield tuple(sources)


def _open(source: LiveSource, key: str, where: str) -> None:
    try:
        source.open()
    except BadInput as error:
        raise BadInput(where, f"{key}.{error.key or 'source'}", error.expected) from error
