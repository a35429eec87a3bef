"""Short runs that all metrics are tried on, made without a world, and what can be done to a run as a whole."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.truth import Light, Static, Truth
from swarmwire.comms.radio.records import ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.metric import Metric
from tests.support.metrics.swarms import mixed, rolled
from tests.support.metrics.truths import static, tally, truth

Array = np.ndarray[Any, Any]
TICKS, TICK_NS, RANGE_M = 10, 100_000_000, 1.6
ROWS = "alive", "pose", "velocity", "command", "value"  # columns with a row for each robot
FATES = Fate.RECEIVED, Fate.RECEIVED, Fate.RECEIVED, Fate.LOST, Fate.COLLIDED


@dataclass(frozen=True)
class History:
    """What there is, and what happened, tick by tick."""

    static: Static
    ticks: tuple[Truth, ...]

    def each(self, change: Callable[[Truth], Truth]) -> "History":
        """The same with each tick changed."""
        return replace(self, ticks=tuple(map(change, self.ticks)))

    @property
    def alive(self) -> Array:
        """(ticks, arenas, robots)."""
        return np.stack([one.alive for one in self.ticks]).reshape(-1, self.static.arenas, self.static.robots)


def measured(metrics: Sequence[Metric], history: History) -> tuple[Array, list[dict[str, Any]]]:
    """Their values in each tick, (ticks, metrics, arenas), and their summary."""
    observer, values = Metrics(metrics), []
    observer.begin(history.static)
    for tick in history.ticks:
        observer.see(tick)
        values.append(observer.values.copy())
    return np.array(values), observer.end(None)["metrics"]


def _positions(rng: Any, boundary: str, shape: tuple[int, int, int], spread: float) -> Array:
    """Walks (ticks, rows, 2) around one point; with a small spread they stay within a quarter of each side of 0."""
    compact = spread < 0.5
    middle_m = np.zeros(2) if compact else rng.uniform(-2.0, 2.0, 2)
    start_m = middle_m + spread * rng.uniform((-3.9, -2.9), (3.9, 2.9), (shape[1], 2))
    some = rng.integers(0, shape[1], 2)
    start_m[some[0]] = start_m[some[1]]  # one stands where another does
    place_m = start_m + np.cumsum(rng.normal(0.0, 0.03, shape) * (rng.random(shape[1:2]) < 0.7)[:, None], axis=0)
    return rolled(place_m) if boundary == "torus" else place_m


def _links(rng: Any, run: Static, alive: Array, tick: int) -> ReceptionRecords:
    """Some packets of robots alive to others of their arena, sent in the last few ticks."""
    pairs = [
        (arena, a, b)
        for arena, living in enumerate(alive)
        for a in range(run.robots)
        for b in range(run.robots)
        if a != b and living[a] and living[b]
    ]
    chosen = rng.permutation(len(pairs))[: rng.integers(0, 12)]
    arena, sender, receiver = np.array([pairs[k] for k in chosen], np.int64).reshape(-1, 3).T.copy()
    one, final_ns = np.ones_like(arena), tick * TICK_NS - rng.integers(0, TICK_NS, len(arena))
    sent_ns = final_ns - rng.integers(1, 3 * TICK_NS, len(arena))
    fate, size = rng.choice(np.array(FATES, np.int64), len(arena)), rng.integers(8, 90, len(arena))
    return ReceptionRecords(arena, sender, receiver, one, -one, tick * one, sent_ns, sent_ns, final_ns, fate, size, one)


def _packets(rng: Any, alive: Array, tick: int) -> TransmissionRecords:
    arena, sender = (column.copy() for column in np.argwhere(alive & (rng.random(alive.shape) < 0.4)).T)
    one, on_ns = np.ones_like(arena), tick * TICK_NS - rng.integers(0, TICK_NS, len(arena))
    off_ns = on_ns + rng.integers(1, 2 * TICK_NS, len(arena))
    return TransmissionRecords(
        arena, sender, BROADCAST * one, tick * one, one, 0 * one, Fate.RECEIVED + 0 * one, on_ns, off_ns
    )


def _edges(run: Static, place_m: Array, alive: Array) -> Array:
    """Pairs of rows of robots alive of one arena in range."""
    away_m = place_m[:, None] - place_m[None]
    away_m = rolled(away_m) if run.boundary == "torus" else away_m
    arena = np.arange(len(place_m)) // run.robots
    near = (np.hypot(away_m[..., 0], away_m[..., 1]) < RANGE_M) & (arena[:, None] == arena[None])
    return np.argwhere(np.triu(near & alive[:, None] & alive[None], 1))


def make(seed: int, boundary: str, spread: float, robots: int, arenas: int, dead: float) -> History:
    """A run: robots walk, turn, die and live again, touch, note values and send; some are dead all the time."""
    rng = np.random.default_rng(seed)
    lights = [[Light(*rng.uniform(-1.3, 1.3, 2), 1.0) for _ in range(2)] for _ in range(arenas)]
    run = mixed(static(robots, arenas, lights=lights), int(rng.integers(1, robots + 1)))
    run = replace(run, boundary=boundary)
    rows = robots * arenas
    place_m = _positions(rng, boundary, (TICKS, rows, 2), spread)
    heading_rad = rng.uniform(-np.pi, np.pi, (TICKS, rows, 1))
    never = rng.random(robots) < dead
    never[0] = False
    ticks = []
    for tick in range(TICKS):
        alive = (rng.random(rows) >= dead) & ~np.tile(never, arenas)
        living = alive.reshape(arenas, robots)
        fields: dict[str, Any] = {
            "alive": alive,
            "pose": np.concatenate([place_m[tick], heading_rad[tick]], axis=1),
            "velocity": rng.normal(0.0, 0.1, (rows, 3)) * (rng.random((rows, 1)) < 0.9),
            "command": rng.normal(0.0, 0.1, (rows, 3)),
            "contact_onsets": rng.integers(0, 3, (arenas, 2)),
            "value": np.where(alive & (rng.random(rows) < 0.6), rng.normal(5.0, 2.0, rows), np.nan) if tick else None,
        }
        counts = [{fate: int(rng.integers(0, 5)) for fate in (*FATES, Fate.OUT_OF_RANGE)} for _ in range(arenas)]
        fields |= {"edges": _edges(run, place_m[tick], alive), "tally": tally(*counts)}
        fields["finished"], fields["departed"] = _links(rng, run, living, tick), _packets(rng, living, tick)
        ticks.append(truth(run, tick, **fields))
    return History(run, tuple(ticks))


@st.composite
def histories(
    draw: st.DrawFn,
    boundaries: Sequence[str] = ("walls", "open", "torus"),
    spreads: Sequence[float] = (0.33, 1.0, 0.04),
) -> History:
    """Runs of ten ticks: walls or none or a torus, in a heap or spread out, with few or many dead."""
    return make(
        draw(st.integers(0, 10**6)),
        draw(st.sampled_from(boundaries)),
        draw(st.sampled_from(spreads)),
        draw(st.integers(1, 9)),
        draw(st.integers(1, 3)),
        draw(st.sampled_from([0.0, 0.2, 0.7])),
    )


def at_rest(robots: int, alive: bool) -> History:
    """Robots in the middle that do nothing, say nothing and hear nothing, 1 m from a light."""
    run = static(robots, lights=[[Light(1.0, 0.0, 1.0)]])
    fields: dict[str, Any] = {"alive": np.full(robots, alive), "edges": np.zeros((0, 2), np.int64)}
    fields |= {
        "finished": no_rows(ReceptionRecords),
        "departed": no_rows(TransmissionRecords),
        "tally": tally({}, sent=0),
    }
    return History(run, tuple(truth(run, tick, **fields) for tick in range(TICKS)))


def no_rows(table: type) -> Any:
    """A table of packets without any."""
    return table(*(np.zeros(0, np.int64) for field in fields(table) if field.default is not None))


def chosen(table: Any, rows: Array, **columns: Array) -> Any:
    """These rows of a table of packets, some of its columns replaced."""
    columns_by_name = {field.name: getattr(table, field.name) for field in fields(table)} | columns
    return type(table)(**{name: None if column is None else column[rows] for name, column in columns_by_name.items()})


def placed(history: History, by_m: tuple[float, float], turn_rad: float = 0.0, mirror: bool = False) -> History:
    """The scene, lights and all, mirrored at the x axis, turned around the origin and moved.

    On a torus the turn must be 0 or half a turn.
    """
    side = -1.0 if mirror else 1.0
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turn, torus = np.array([[c, s], [-side * s, side * c]]), history.static.boundary == "torus"

    def move(at_m: Array) -> Array:
        there_m = at_m @ turn + by_m
        return rolled(there_m) if torus else there_m

    def change(truth: Truth) -> Truth:
        pose = np.column_stack([move(truth.pose[:, :2]), side * truth.pose[:, 2] + turn_rad])
        velocity = np.column_stack([truth.velocity[:, :2] @ turn, side * truth.velocity[:, 2]])
        return replace(truth, pose=pose, velocity=velocity, command=truth.command * (1.0, side, side))

    lights = tuple(
        tuple(Light(*move(np.array([one.x_m, one.y_m])).tolist(), one.intensity_m) for one in own)
        for own in history.static.lights
    )
    return replace(history, static=replace(history.static, lights=lights)).each(change)


def robots_taken(history: History, robots: Array) -> History:
    """The run of these robots (k,) of each arena alone, in this order, which keeps the robots of a group together."""
    run = history.static
    rows = (np.arange(run.arenas)[:, None] * run.robots + robots).ravel()
    index = np.full(run.robots, -1)
    index[robots] = np.arange(len(robots))
    row = np.full(run.arenas * run.robots, -1)
    row[rows] = np.arange(len(rows))

    def change(truth: Truth) -> Truth:
        own = {name: getattr(truth, name)[rows] for name in ROWS if getattr(truth, name) is not None}
        own |= {"state": truth.state[rows], "leds": truth.leds[rows]}
        if truth.edges is not None:
            own["edges"] = row[truth.edges]
        for name, columns in (("finished", ("sender", "receiver")), ("departed", ("sender",))):
            table = getattr(truth, name)
            if table is not None:
                named = {column: index[getattr(table, column)] for column in columns}
                own[name] = chosen(table, np.arange(len(table.arena)), **named)
        return replace(truth, **own)

    groups, start = [], 0
    for group in run.groups:
        stop = start + int(np.count_nonzero((robots >= group.start) & (robots < group.stop)))
        groups.append(replace(group, start=start, stop=stop))
        start = stop
    names = tuple(run.robot_names[robot] for robot in robots)
    return replace(history, static=replace(run, groups=tuple(groups), robot_names=names)).each(change)


def packets_shuffled(history: History, rng: Any) -> History:
    """The same edges and packets in each tick, told in another order."""

    def change(truth: Truth) -> Truth:
        own = {name: getattr(truth, name) for name in ("finished", "departed")}
        own = {name: chosen(table, rng.permutation(len(table.arena))) for name, table in own.items() if table}
        return replace(truth, edges=None if truth.edges is None else rng.permutation(truth.edges), **own)

    return history.each(change)


def arena_alone(history: History, arena: int) -> History:
    """The run of one arena, as if there were no other."""
    run = history.static
    rows = slice(arena * run.robots, (arena + 1) * run.robots)
    only = np.arange(run.arenas) == arena

    def change(truth: Truth) -> Truth:
        own = {name: getattr(truth, name)[rows] for name in ROWS if getattr(truth, name) is not None}
        own |= {"running": truth.running[only], "contact_onsets": truth.contact_onsets[only]}
        own |= {"state": truth.state[rows], "leds": truth.leds[rows]}
        if truth.edges is not None and truth.tally is not None:
            own["edges"] = truth.edges[truth.edges[:, 0] // run.robots == arena] - rows.start
            own["tally"] = type(truth.tally)(*(getattr(truth.tally, field.name)[only] for field in fields(truth.tally)))
        for name in ("finished", "departed"):
            table = getattr(truth, name)
            if table is not None:
                own[name] = chosen(table, table.arena == arena, arena=0 * table.arena)
        return replace(truth, **own)

    alone = replace(run, seeds=run.seeds[arena : arena + 1], obstacles=run.obstacles[:1], lights=run.lights[arena:][:1])
    return replace(history, static=alone).each(change)


def with_the_dead_elsewhere(history: History, rng: Any) -> History:
    """The same but for what the dead of the last tick do there, and where they are."""
    last = history.ticks[-1]
    dead = ~last.alive
    own = {}
    for name in ROWS[1:]:
        column = getattr(last, name)
        if column is not None:
            own[name] = column.copy()
            own[name][dead] = rng.normal(0.0, 1.0, own[name][dead].shape)
    return replace(history, ticks=(*history.ticks[:-1], replace(last, **own)))


def and_then_nothing(history: History) -> History:
    """One tick more, in which all stands still."""
    last = history.ticks[-1]
    own: dict[str, Any] = {"tick": last.tick + 1, "time_ns": last.time_ns + TICK_NS}
    own["contact_onsets"] = 0 * last.contact_onsets
    if last.tally is not None:
        own |= {"finished": no_rows(ReceptionRecords), "departed": no_rows(TransmissionRecords)}
        own["tally"] = tally(*[{}] * history.static.arenas, sent=0)
    return replace(history, ticks=(*history.ticks, replace(last, **own)))


def arena_left(history: History, arena: int, tick: int) -> History:
    """The same, but that this arena has left from a tick on: nobody lives there, and nothing is received or touched."""
    is_left = np.arange(history.static.arenas) == arena
    rows = np.repeat(is_left, history.static.robots)

    def change(truth: Truth) -> Truth:
        if truth.tick < tick:
            return truth
        own: dict[str, Any] = {"running": ~is_left, "alive": truth.alive & ~rows}
        own["contact_onsets"] = truth.contact_onsets * ~is_left[:, None]
        if truth.edges is not None and truth.tally and truth.finished and truth.departed:
            own |= {name: getattr(truth, name).in_arenas(~is_left) for name in ("finished", "departed", "tally")}
            own["edges"] = truth.edges[~rows[truth.edges[:, 0]]]
        return replace(truth, **own)

    return history.each(change)
