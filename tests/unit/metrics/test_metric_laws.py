"""Laws that hold for every metric: where the swarm stands, who is counted, and what goes on elsewhere.

Each metric of the registry is tried; where a law does not hold for it, or other parameters show more, it has a line in
`LAWS`. An exemption is tested, too: somewhere the law must be broken. What a metric's values are is tested beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.measures.metric import Metric
from swarmwire.metrics.measures.registry import METRICS
from tests.support.metrics.histories import (
    TICKS,
    Array,
    History,
    and_then_nothing,
    arena_alone,
    arena_left,
    at_rest,
    histories,
    make,
    measured,
    packets_shuffled,
    placed,
    robots_taken,
    with_the_dead_elsewhere,
)

NAN = np.nan
law = settings(max_examples=min(settings().max_examples, 30))  # each measures all metrics, twice or more
Pause = Callable[[Array], Array]  # from the value before a tick in which nothing happens to that after it


def same(value: Array) -> Array:
    return value


def nothing(value: Array) -> Array:
    return 0.0 * value


def a_tick_older(value: Array) -> Array:
    return value + 0.1


@dataclass(frozen=True)
class Laws:
    """How a metric is tried, and where it is an exception.

    Attributes:
        nobody: its value where nobody was ever alive.
        lone: of a robot that does nothing and hears nothing, 1 m from a light.
        parameters: other than its own, so that much happens within ten ticks.
        radio: it tells of the radio, and has no value without one; others have the same value.
        pause: what becomes of it in a tick in which nothing happens; None: time alone changes it.
        anywhere: it does not matter where in the arena the swarm is, nor which way it is turned.
        numbers: it depends on how robots are numbered.
        dead: what the dead are and do counts.
    """

    nobody: float = NAN
    lone: float = NAN
    parameters: tuple[tuple[str, object], ...] = ()
    radio: bool = False
    pause: Pause | None = same
    anywhere: bool = True
    numbers: bool = False
    dead: bool = False


FRAGMENTS = Laws(radio=True, parameters=(("hold_s", 0.2),))
WINDOW = Laws(radio=True, pause=None, parameters=(("window_s", 0.3),))
SAMPLED = Laws(radio=True, parameters=(("every_s", 0.0),))
COVERAGE = (("sensing_m", 0.53), ("cell_m", 0.31))
LAWS = {name: Laws() for name in METRICS} | {
    "order": Laws(lone=1.0),
    "order_velocity": Laws(lone=0.0),
    "order_local": Laws(lone=1.0, parameters=(("range_m", 1.03),)),
    "rotation": Laws(lone=0.0),
    "speed": Laws(lone=0.0),
    "cohesion": Laws(lone=0.0),
    "dispersion": Laws(lone=0.0),
    "aggregation": Laws(lone=1.0, parameters=(("gap_m", 0.37),)),
    "aggregation_hop": Laws(lone=1.0, parameters=(("gap_m", 0.37),), numbers=True),
    "aggregation_time_s": Laws(lone=0.0, parameters=(("gap_m", 0.37), ("share", 0.6))),
    "collisions": Laws(nobody=0.0, lone=0.0),
    "wall_contacts": Laws(nobody=0.0, lone=0.0),
    "collision_rate": Laws(lone=0.0, pause=None),
    "oscillation": Laws(lone=0.0, pause=None),
    "deadlocked": Laws(lone=0.0, pause=None, parameters=(("window_s", 0.3), ("told_m", 0.02))),
    "components": Laws(nobody=0.0, lone=1.0, radio=True),
    "largest_component": Laws(lone=1.0, radio=True),
    "algebraic_connectivity": SAMPLED,
    "articulation": replace(SAMPLED, lone=0.0),
    "fragmentations": replace(FRAGMENTS, nobody=0.0, lone=0.0, pause=None),
    "fragmented": replace(FRAGMENTS, nobody=0.0, lone=0.0, pause=None),
    "unrejoined": replace(FRAGMENTS, pause=None),
    "rejoin_median": FRAGMENTS,
    "rejoin_worst": FRAGMENTS,
    "age_of_information": Laws(radio=True, pause=a_tick_older),
    "peak_age_of_information": WINDOW,
    "throughput": Laws(nobody=0.0, lone=0.0, radio=True, pause=nothing),
    "airtime": Laws(lone=0.0, radio=True, pause=None),
    "pdr": WINDOW,
    "link_pdr": WINDOW,
    "latency_air": WINDOW,
    "latency_agent": WINDOW,
    "target_best": Laws(lone=1.0),
    "target_mean": Laws(lone=1.0),
    "find_time_s": Laws(lone=0.0, parameters=(("within_m", 1.07), ("share", 0.5))),
    "coverage": Laws(nobody=0.0, lone=12 / 520, anywhere=False, parameters=COVERAGE),
    "coverage_time_s": Laws(lone=0.0, anywhere=False, parameters=(*COVERAGE, ("share", 0.015))),
    "consensus_bias": Laws(dead=True),
}


@cache
def tried() -> tuple[Metric, ...]:
    return tuple(METRICS[name](**dict(laws.parameters)) for name, laws in LAWS.items())


def measure(history: History) -> Array:
    """Of all metrics in each tick, (ticks, metrics, arenas)."""
    return measured(tried(), history)[0]


def broken(values: Array, expected: Array, but: Callable[[Laws], bool] = lambda _: False) -> set[str]:
    """The metrics whose values (…, metrics, arenas) differ by more than rounding, without those that are exempt."""
    fits = np.isclose(values, expected, rtol=1e-7, atol=1e-7, equal_nan=True)
    rows = fits.swapaxes(-2, 0).reshape(len(LAWS), -1).all(axis=1)
    return {name for (name, laws), fit in zip(LAWS.items(), rows, strict=True) if not fit and not but(laws)}


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Kernels are compiled before the first test, whose time is limited."""
    measure(make(1, "torus", 1.0, 4, 2, 0.2))


def test_laws_exist_for_every_metric() -> None:
    assert set(LAWS) == set(METRICS)


@law
@given(histories(["walls", "open"]), st.floats(-2, 2), st.floats(-2, 2), st.floats(-np.pi, np.pi), st.booleans())
def test_moved_turned_or_mirrored_scene_has_equal_metrics(
    history: History, x_m: float, y_m: float, turn_rad: float, mirror: bool
) -> None:
    elsewhere = placed(history, (x_m, y_m), turn_rad, mirror)
    assert not broken(measure(elsewhere), measure(history), but=lambda laws: not laws.anywhere)


@law
@given(histories(), st.sampled_from([0.0, np.pi]), st.booleans())
def test_arena_turned_or_mirrored_has_equal_metrics(history: History, turn_rad: float, mirror: bool) -> None:
    assert not broken(measure(placed(history, (0.0, 0.0), turn_rad, mirror)), measure(history))


@law
@given(histories(["torus"]), st.floats(-8, 8), st.floats(-6, 6))
def test_torus_moved_across_its_seam_has_equal_metrics(history: History, x_m: float, y_m: float) -> None:
    moved = placed(history, (x_m, y_m))
    assert not broken(measure(moved), measure(history), but=lambda laws: not laws.anywhere)


@law
@given(histories(["open"], spreads=[0.33, 0.1, 0.03]))
def test_on_a_torus_of_more_than_twice_its_size_a_swarm_has_what_it_has_on_a_plane(history: History) -> None:
    torus = replace(history, static=replace(history.static, boundary="torus"))
    assert not broken(measure(torus), measure(history))


@law
@given(histories())
def test_arena_alone_has_the_exact_metrics_it_has_beside_others(history: History) -> None:
    together = measure(history)
    for arena in range(history.static.arenas):
        alone = measure(arena_alone(history, arena))[:, :, 0]
        equal = (alone == together[:, :, arena]) | (np.isnan(alone) & np.isnan(together[:, :, arena]))
        assert not {name for name, fits in zip(LAWS, equal.all(axis=0), strict=True) if not fits}


@law
@given(histories(), st.integers(0, 2), st.integers(1, TICKS - 1))
def test_arena_that_left_keeps_its_values_and_changes_no_others(history: History, arena: int, tick: int) -> None:
    arena %= history.static.arenas
    values, summary = measured(tried(), arena_left(history, arena, tick))
    cut_values, cut_summary = measured(tried(), replace(history, ticks=history.ticks[:tick]))
    expected = measure(history)
    expected[tick:, :, arena] = cut_values[-1, :, arena]
    assert not broken(values, expected)
    assert summary[arena] == cut_summary[arena]


def renumbered(history: History, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    order = [rng.permutation(np.arange(group.start, group.stop)) for group in history.static.groups]
    return measure(packets_shuffled(robots_taken(history, np.concatenate(order)), rng))


@law
@given(histories(), st.integers(0, 100))
def test_robots_and_packets_have_no_order(history: History, seed: int) -> None:
    assert not broken(renumbered(history, seed), measure(history), but=lambda laws: laws.numbers)


@law
@given(histories(), st.integers(0, 100))
def test_dead_robots_position_and_actions_change_no_metric(history: History, seed: int) -> None:
    elsewhere = with_the_dead_elsewhere(history, np.random.default_rng(seed))
    assert not broken(measure(elsewhere)[-1], measure(history)[-1], but=lambda laws: laws.dead)


@law
@given(histories())
def test_robot_that_never_lives_changes_no_metric(history: History) -> None:
    lives = history.alive.any(axis=(0, 1))
    assert not broken(measure(robots_taken(history, np.flatnonzero(lives))), measure(history))


@law
@given(histories())
def test_tick_without_events_changes_no_metric(history: History) -> None:
    before, after = measure(and_then_nothing(history))[-2:]
    expected = [(laws.pause or same)(own) for laws, own in zip(LAWS.values(), before, strict=True)]
    assert not broken(after, np.array(expected), but=lambda laws: laws.pause is None)


@pytest.mark.parametrize("robots", [1, 5])
def test_dead_swarm_has_the_value_of_nobody_in_every_tick(robots: int) -> None:
    expected = np.array([[laws.nobody] for laws in LAWS.values()])
    assert not broken(measure(at_rest(robots, alive=False)), np.broadcast_to(expected, (TICKS, len(LAWS), 1)))


def test_lone_robot_has_its_known_value_of_each_metric() -> None:
    expected = np.array([[laws.lone] for laws in LAWS.values()])
    assert not broken(measure(at_rest(1, alive=True))[-1], expected)


@law
@given(histories())
def test_without_a_radio_only_what_tells_of_it_has_no_value(history: History) -> None:
    names = ("edges", "tally", "finished", "departed")
    expected = measure(history)
    expected[:, [laws.radio for laws in LAWS.values()]] = NAN
    assert not broken(measure(history.each(lambda truth: replace(truth, **dict.fromkeys(names)))), expected)


@law
@given(histories())
def test_metric_object_serves_many_runs_alike(history: History) -> None:
    first = measure(history)
    np.testing.assert_array_equal(measure(history), first)


@law
@given(histories())
def test_values_are_within_bounds_counts_only_grow_and_times_stay(history: History) -> None:
    for metric, values in zip(tried(), measure(history).swapaxes(0, 1), strict=True):
        low, high = metric.bounds
        defined = values[~np.isnan(values)]
        assert low is None or (defined >= low).all(), metric.name
        assert high is None or (defined <= high).all(), metric.name
        if metric.kind != "level":
            earlier, later = values[:-1], values[1:]
            grows = later >= earlier if metric.kind == "count" else later == earlier
            assert (grows | np.isnan(earlier)).all(), metric.name


def witnesses(name: str) -> Callable[[History], bool] | None:
    """Whether a run breaks the law that this metric is exempt from."""
    laws = LAWS[name]
    if laws.numbers:
        return lambda history: name in broken(renumbered(history, 1), measure(history))
    if laws.dead:
        rng = np.random.default_rng(1)
        return lambda history: name in broken(measure(with_the_dead_elsewhere(history, rng)), measure(history))
    if not laws.anywhere:
        return lambda history: name in broken(measure(placed(history, (1.7, 1.4), 0.7)), measure(history))
    if laws.pause is None:
        return lambda history: name in broken(*measure(and_then_nothing(history))[-2:])
    return None


@pytest.mark.parametrize("name", [name for name in LAWS if witnesses(name)])
def test_exemption_from_a_law_has_a_witness(name: str) -> None:
    witness = witnesses(name)
    assert witness
    runs = (make(seed, "walls", 0.2 + seed % 3 * 0.4, 7, 2, 0.2) for seed in range(40))
    assert any(map(witness, runs))
