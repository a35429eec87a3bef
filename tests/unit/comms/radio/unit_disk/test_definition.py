"""The unit disk against its definition in plain Python: one packet and one receiver at a time, with short loops.

The rules are those of docs/radio.md; keyed draws come from `comms.base.draws`.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, cos, dist, floor, inf, sin, sqrt
from typing import cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.packets import Fate, SentPackets
from tests.support.comms.radio import OBSTACLES, RADIOS, RATE_HZ, SIZE_M, TICK_NS, packets

ARENAS, TICKS = 2, 6
PLACED = [replace(obstacle, height_m=height_m) for obstacle, height_m in zip(OBSTACLES, (0.4, inf), strict=True)]
Point = tuple[float, float, float]


@dataclass
class Scene:
    """Robots in two arenas that move from tick to tick, and the packets that they send in each tick."""

    radio: Radio
    robots: int  # per arena
    keys: list[int]  # (arenas,)
    poses: FloatArray  # (ticks + 1, rows, 4)
    sent: list[SentPackets]  # (ticks,)
    is_torus: bool


# The definition.


def draw(key: int, sender: int, receiver: int, sequence: int, name: str) -> float:
    """Return the keyed draw with this purpose."""
    return float(uniform(key, sender, receiver, sequence, purpose(name)))


def send_offset_ns(radio: Radio, key: int, robot: int, tick: int) -> int:
    """Return the time within a tick at which a robot sends: a keyed phase over the tick, and a jitter of a fifth."""
    if radio.send_offset == "uniform":
        phase_ns = floor(draw(key, robot, 0, 0, "send phase") * TICK_NS)
        return phase_ns + floor(draw(key, robot, tick, 0, "send jitter") * (TICK_NS // 5))
    return 0 if isinstance(radio.send_offset, str) else round(radio.send_offset * 1e9)


def is_hit(obstacle: Obstacle, a: Point, b: Point) -> bool:
    """Return True if the line from a to b crosses a cylinder or a box: in its frame, clipped side by side."""
    c, s = cos(obstacle.heading_rad), sin(obstacle.heading_rad)
    ends = [(x - obstacle.x_m, y - obstacle.y_m) for x, y, _ in (a, b)]
    (ax, ay), (bx, by) = ((c * x + s * y, c * y - s * x) for x, y in ends)
    dx, dy, dz, enter, leave = bx - ax, by - ay, b[2] - a[2], 0.0, 1.0
    if obstacle.shape == "cylinder":
        middle, length2 = -(ax * dx + ay * dy) / (dx * dx + dy * dy), dx * dx + dy * dy
        half2 = middle * middle - (ax * ax + ay * ay - obstacle.radius_m**2) / length2
        half = sqrt(max(half2, 0.0))
        enter, leave = (max(middle - half, 0.0), min(middle + half, 1.0)) if half2 > 0.0 else (1.0, 0.0)
    else:
        for start, step, half in ((ax, dx, obstacle.size_m[0] / 2), (ay, dy, obstacle.size_m[1] / 2)):
            low, high = sorted(((-half - start) / step, (half - start) / step))
            enter, leave = max(enter, low), min(leave, high)
    return enter < leave and min(a[2] + enter * dz, a[2] + leave * dz) < obstacle.height_m


def reach(scene: Scene, tick: int, sender: int, receiver: int) -> Fate:
    """Return RECEIVED for a receiver in range and in sight under the poses of a tick, else the drop reason."""
    a, b = (cast("Point", tuple(scene.poses[tick, row, [0, 1, 3]].tolist())) for row in (sender, receiver))
    dx, dy, dz = (end - start for start, end in zip(a, b, strict=True))
    if scene.is_torus:
        dx, dy = dx - SIZE_M[0] * round(dx / SIZE_M[0]), dy - SIZE_M[1] * round(dy / SIZE_M[1])
    if dist((dx, dy, dz), (0.0, 0.0, 0.0)) > cast("float", scene.radio.range_m):
        return Fate.OUT_OF_RANGE
    if scene.radio.needs_line_of_sight and any(is_hit(obstacle, a, b) for obstacle in PLACED):
        return Fate.BLOCKED
    return Fate.RECEIVED


@dataclass
class Packet:
    """One packet and its fate at the sender's radio; `sender` is a robot row, `robot` its index in the arena."""

    sender: int
    arena: int
    robot: int
    receivers: list[int]  # robot rows
    sequence: int
    sent_ns: int
    on_air_ns: int
    off_air_ns: int
    refused: Fate | None  # QUEUE_FULL or TOO_LARGE; on air and off air are then when it was sent


def queue(scene: Scene, sender: int) -> Iterator[Packet]:
    """Yield the packets of one sender: first in, first out, with at most `queue_limit` packets that wait."""
    radio, robots, free_ns, on_air_times = scene.radio, scene.robots, 0, []
    arena, robot = divmod(sender, robots)
    others = [row for row in range(arena * robots, (arena + 1) * robots) if row != sender]
    in_order = [(tick, sent, k) for tick, sent in enumerate(scene.sent) for k in np.flatnonzero(sent.sender == sender)]
    for sequence, (tick, sent, k) in enumerate(in_order):
        size, receivers = int(sent.payloads.sizes[k]), others
        if sent.to[k] != BROADCAST:
            receivers = [arena * robots + int(sent.to[k])]
        sent_ns = tick * TICK_NS + send_offset_ns(radio, scene.keys[arena], robot, tick)
        on_air_ns = max(sent_ns, free_ns)
        waiting = sum(start_ns > sent_ns for start_ns in on_air_times)
        refused = None
        if size > radio.max_payload_bytes:
            refused = Fate.TOO_LARGE
        elif on_air_ns > sent_ns and waiting >= radio.queue_limit:
            refused = Fate.QUEUE_FULL
        if refused:
            yield Packet(sender, arena, robot, receivers, sequence, sent_ns, sent_ns, sent_ns, refused)
            continue
        on_air_times.append(on_air_ns)
        free_ns = on_air_ns + ceil(8 * (size + radio.overhead_bytes) * 10**9 / radio.bit_rate_bps)
        yield Packet(sender, arena, robot, receivers, sequence, sent_ns, on_air_ns, free_ns, None)


def end_of_link(scene: Scene, packet: Packet, receiver: int) -> tuple[Fate, int]:
    """Return the fate of a packet at a receiver, and the time at which it is final."""
    numbers = scene.keys[packet.arena], packet.robot, receiver % scene.robots, packet.sequence
    fate = reach(scene, packet.on_air_ns // TICK_NS, packet.sender, receiver)
    if fate != Fate.RECEIVED:
        return fate, packet.off_air_ns
    if draw(*numbers, "fixed loss") < scene.radio.loss:
        return Fate.LOST, packet.off_air_ns
    jitter_ns = floor(draw(*numbers, "delay") * round(scene.radio.jitter_s * 1e9))
    return fate, packet.off_air_ns + round(scene.radio.latency_s * 1e9) + jitter_ns


Row = tuple[int, int, int, int, str, int, int, int]  # arena, sender, receiver, sequence, fate, sent, on air, final
Outcome = tuple[list[Row], dict[str, int], int]  # rows of links that ended; receivers by fate; receivers in range


def run_by_definition(scene: Scene) -> Outcome:
    """Return the outcome of a run that ends at the start of the last tick."""
    end_ns, rows, fates, in_range = TICKS * TICK_NS, [], Counter[str](), 0
    for sender in range(ARENAS * scene.robots):
        for packet in queue(scene, sender):
            head, times = (packet.arena, packet.robot), (packet.sent_ns, packet.on_air_ns)
            if packet.on_air_ns >= end_ns:
                fates["IN_FLIGHT"] += len(packet.receivers)
            elif packet.refused:
                rows.append((*head, NO_ROBOT, packet.sequence, packet.refused.name, *times, packet.sent_ns))
                fates[packet.refused.name] += len(packet.receivers)
                reached = [reach(scene, packet.sent_ns // TICK_NS, sender, receiver) for receiver in packet.receivers]
                in_range += reached.count(Fate.RECEIVED) if packet.refused == Fate.QUEUE_FULL else 0
            else:
                for receiver in packet.receivers:
                    fate, final_ns = end_of_link(scene, packet, receiver)
                    if final_ns > end_ns:
                        fates["IN_FLIGHT"] += 1
                        continue
                    fates[fate.name] += 1
                    in_range += fate in (Fate.RECEIVED, Fate.LOST)
                    if fate != Fate.OUT_OF_RANGE:
                        row = receiver % scene.robots, packet.sequence, fate.name, *times, final_ns
                        rows.append((*head, *row))
    return sorted(rows), dict(fates), in_range


# The comparison.


@st.composite
def scenes(draw_value: st.DrawFn) -> Scene:
    """Random robots, poses and packets; on a torus without obstacles in sight."""
    radio, is_torus = draw_value(RADIOS), draw_value(st.booleans())
    robots, rng = draw_value(st.integers(2, 5)), np.random.default_rng(draw_value(st.integers(0, 2**32)))
    half, sent = np.array([*SIZE_M, 6.0]) / 2, []
    z_m = rng.uniform(0.0, draw_value(st.sampled_from([0.0, 1.0, 5.0])), (TICKS + 1, ARENAS * robots, 1))
    for _ in range(TICKS):
        count = rng.integers(0, 4 * robots)
        sender = rng.integers(0, ARENAS * robots, count)
        to = (sender + rng.integers(1, robots, count)) % robots
        to = np.where(rng.random(count) < 0.6, BROADCAST, to)
        sent.append(packets(sender, to, rng.integers(2, 70, count)))
    return Scene(
        radio=replace(radio, line_of_sight=False) if is_torus else radio,
        robots=robots,
        keys=[derive_key(int(rng.integers(10**6)), arena) for arena in range(ARENAS)],
        poses=np.concatenate([rng.uniform(-half, half, (TICKS + 1, ARENAS * robots, 3)), z_m], axis=2),
        sent=sent,
        is_torus=is_torus,
    )


def run_medium(scene: Scene) -> Outcome:
    """Return the same as `run_by_definition`, from the medium's results."""
    obstacles = obstacle_arrays((tuple(PLACED),) * ARENAS)
    keys = np.array(scene.keys, np.uint64)
    context = ChannelContext.open_space(scene.radio, keys, scene.robots, SIZE_M, obstacles)
    medium = RadioMedium(replace(context, is_torus=scene.is_torus), RATE_HZ)
    rows, counts = [], PacketCounts(*np.zeros((3, ARENAS), np.int64), np.zeros((ARENAS, len(Fate)), np.int64))
    for tick in range(TICKS + 1):
        results = medium.step(tick * TICK_NS, scene.poses[tick])
        counts += results.tally
        ended = results.finished
        columns = ended.arena, ended.sender, ended.receiver, ended.sequence
        times = ended.sent_at_ns, ended.on_air_at_ns, ended.final_at_ns
        names = [Fate(fate).name for fate in ended.fate]
        rows += zip(*(column.tolist() for column in columns), names, *(time.tolist() for time in times), strict=True)
        if tick < TICKS:
            medium.send(tick * TICK_NS, tick, scene.sent[tick])
    counts += medium.end()
    fates = {fate.name: int(n) for fate, n in zip(Fate, counts.fates.sum(axis=0), strict=True) if n}
    return sorted(rows), fates, int(counts.in_range.sum())


@given(scenes())
def test_unit_disk_agrees_with_its_definition(scene: Scene):
    rows, fates, in_range = run_medium(scene)
    expected_rows, expected_fates, expected_in_range = run_by_definition(scene)
    assert rows == expected_rows
    assert fates == expected_fates
    assert in_range == expected_in_range
