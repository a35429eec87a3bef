"""The robot's side of the robots' network: one session, which radio, tracker and control share."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from swarmwire.agent.on_robot.control import Control
from swarmwire.agent.on_robot.needs import OF_POSES
from swarmwire.agent.on_robot.no_radio import NoRadio
from swarmwire.agent.on_robot.plan import Plan
from swarmwire.agent.on_robot.presence import Presence
from swarmwire.agent.on_robot.settings import RobotSettings
from swarmwire.agent.radios.radio import RobotRadio
from swarmwire.agent.radios.radio_log import RadioLog
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.wire.radio_bridge import Pose

if TYPE_CHECKING:
    import zenoh

    from swarmwire.agent.radios.tracker import Tracker
    from swarmwire.comms.wire.robot_network import SwarmKeys

Say = Callable[[str], None]


def nowhere() -> Pose | None:
    """Where a robot without a tracker is."""
    return None


@dataclass(frozen=True)
class NetworkParts:
    """What of a robot stands on its network, open; of a robot without one nobody hears, sees or asks."""

    radio: RobotRadio = field(default_factory=NoRadio)
    own_pose: Callable[[], Pose | None] = nowhere
    look: Callable[[], None] = lambda: None  # once a second: tell whether others are heard, and poses come
    counts: Callable[[], dict[str, int]] = dict  # what came to tracker and control and was of no use
    listen: Callable[[Control], None] = lambda _: None  # let the robot be controlled from now on


def network_parts(plan: Plan, clock: DatedClock, log: RadioLog | None, say: Say, closing: ExitStack) -> NetworkParts:
    """Radio, tracker and control as the settings say; `closing` is given what is to be closed at the end.

    BadInput if an endpoint is taken, or there is no world whose air is to be joined, or it has not this robot.
    """
    settings = plan.settings
    network = settings.network
    if network is None:
        return NetworkParts()
    # zenoh costs memory and time, and is of no use to a robot by itself.
    from swarmwire.agent.radios.control import ControlPoint
    from swarmwire.comms.wire.access_control import access_of
    from swarmwire.comms.wire.robot_network import SwarmKeys, open_swarm
    from swarmwire.comms.wire.sessions import close_session

    if network.warning:
        say(network.warning)
    keys, own = SwarmKeys(settings.swarm), settings.name
    session = open_swarm(network, access_of(network, keys, settings.robots, own))
    closing.callback(close_session, session)
    tracker = _opened_tracker(settings, session, keys, closing)
    radio = _made_radio(plan, session, keys, tracker, clock, log, say)
    closing.callback(radio.close)
    radio.open()

    def own_pose() -> Pose | None:
        return tracker.pose(own, clock.utc_ns()) if tracker else None

    presence = Presence(clock, say, *_others(settings, radio), own_pose if tracker else None, settings.pace)
    points: list[ControlPoint] = []

    def listen(control: Control) -> None:
        point = ControlPoint(session, keys, own, control)
        closing.callback(point.close)
        point.open()
        points.append(point)

    def counts() -> dict[str, int]:
        of_tracker = tracker.counts() if tracker else {}
        of_points = {name: count for point in points for name, count in point.counts().items()}
        return of_tracker | presence.counts() | of_points

    return NetworkParts(radio, own_pose, presence.look, counts, listen)


def _opened_tracker(
    settings: RobotSettings, session: "zenoh.Session", keys: "SwarmKeys", closing: ExitStack
) -> "Tracker | None":
    """Poses of all robots, or only its own: the air of a world tells range and bearing itself."""
    from swarmwire.agent.radios.tracker import Tracker

    if not settings.tracker:
        return None
    tracker = Tracker(session, keys, settings.robots if settings.radio.kind == "zenoh" else (settings.name,))
    closing.callback(tracker.close)
    tracker.open()
    return tracker


def _made_radio(
    plan: Plan,
    session: "zenoh.Session",
    keys: "SwarmKeys",
    tracker: "Tracker | None",
    clock: DatedClock,
    log: RadioLog | None,
    say: Say,
) -> RobotRadio:
    """The radio of this kind, not open yet."""
    from swarmwire.agent.radios.air_radio import AirRadio
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    robots, own, radio = plan.settings.robots, plan.settings.name, plan.settings.radio
    if radio.kind == "zenoh":
        asks_pose = any(need in OF_POSES for need in plan.agent.needs)
        return ZenohRadio(session, keys, robots, own, radio.max_payload_bytes, clock, tracker, asks_pose, log, say)
    return AirRadio(session, keys, robots, own, clock, log) if radio.kind == "air" else NoRadio()


def _others(settings: RobotSettings, radio: RobotRadio) -> tuple[list[str], Callable[[], list[str]]]:
    """Whom the robot is to hear, and what tells whom it has heard so far: known of the robots' own network alone."""
    from swarmwire.agent.radios.zenoh_radio import ZenohRadio

    if not isinstance(radio, ZenohRadio):
        return [], list
    others = [robot for robot in settings.robots if robot != settings.name]
    return others, lambda: [settings.robots[sender] for sender in list(radio.links)]
