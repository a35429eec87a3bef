"""The points of a design: at which values of the varied paths a scenario is run."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product
from math import floor, prod
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.config import did_you_mean
from swarmwire.comms.draws import derive_key, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.vary import Range, Vary

Point = dict[str, Any]  # by path: the value
GRID, LIST, RANDOM, LATIN = KINDS = ("grid", "list", "random", "latin")
DRAWN = (RANDOM, LATIN)
MAX_POINTS = 100_000


def points_of(
    kind: str, varied: Sequence[Vary], count: int | None, seed: int, is_whole: Callable[[str], bool]
) -> list[Point]:
    """The design's points, in order; without anything varied a grid is the scenario itself, one point.

    `grid` combines all values, the last path's the fastest; `list` takes them one to one; `random` and `latin` draw
    `count` points from ranges (and lists) by `seed`. Where `is_whole(path)`, ranges give whole numbers. BadInput says
    which argument is wrong.
    """
    if kind not in KINDS:
        raise BadInput("--design", "", f"expected {did_you_mean(KINDS, kind)}; got {kind!r}")
    for place, vary in enumerate(varied):
        if vary.path in [other.path for other in varied[:place]]:
            raise vary.refused("expected each path once")
    if kind in DRAWN:
        return _drawn(kind, varied, count, seed, is_whole)
    if count is not None:
        raise BadInput("--points", "", f"expected it with --design {RANDOM} or {LATIN}: the values say how many")
    values = [_values(vary, is_whole(vary.path)) for vary in varied]
    if kind == LIST:
        return _one_to_one(varied, values)
    if prod(map(len, values)) > MAX_POINTS:
        raise BadInput("--vary", "", f"expected at most {MAX_POINTS} points, got {prod(map(len, values))}")
    return [_point(varied, combined) for combined in product(*values)]


def _one_to_one(varied: Sequence[Vary], values: Sequence[Sequence[Any]]) -> list[Point]:
    if not varied:
        raise BadInput("--design", "", f"expected --vary with {LIST}: the design is empty")
    for vary, of in zip(varied, values, strict=True):
        if len(of) != len(values[0]):
            raise vary.refused(f"expected {len(values[0])} values, as of {varied[0].path}; got {len(of)}")
    return [_point(varied, combined) for combined in zip(*values, strict=True)]


def _values(vary: Vary, whole: bool) -> list[Any]:
    if not isinstance(vary.values, Range):
        return list(vary.values)
    if vary.values.count is None:
        raise vary.refused(f"expected FIRST:LAST:COUNT; FIRST:LAST is for --design {RANDOM} and {LATIN}")
    found = vary.values.values()
    if not whole:
        return list(found)
    rounded = [floor(value + 0.5) for value in found]
    if len(set(rounded)) < len(rounded):
        raise vary.refused("expected a smaller COUNT: rounded to whole numbers some values are the same")
    return list(rounded)


def _drawn(
    kind: str, varied: Sequence[Vary], count: int | None, seed: int, is_whole: Callable[[str], bool]
) -> list[Point]:
    if not varied:
        raise BadInput("--design", "", f"expected --vary with {kind}: the design is empty")
    if count is None or not 0 < count <= MAX_POINTS:
        raise BadInput("--points", "", f"expected 1 to {MAX_POINTS} points with --design {kind}, got {count}")
    if seed < 0:
        raise BadInput("--design-seed", "", f"expected a whole number of at least 0, got {seed}")
    shares = _random(varied, count, seed) if kind == RANDOM else _latin(len(varied), count, seed)
    wholes = [is_whole(vary.path) for vary in varied]
    return [
        _point(varied, [_at(vary, float(share), whole) for vary, share, whole in zip(varied, row, wholes, strict=True)])
        for row in shares
    ]


def _random(varied: Sequence[Vary], count: int, seed: int) -> FloatArray:
    """Shares in [0, 1), (points, paths): each path has draws of its own, whatever else is varied."""
    columns = [uniform(derive_key("design", seed, vary.path), np.arange(count), 0, 0, 0) for vary in varied]
    return np.stack(columns, axis=1)


def _latin(paths: int, count: int, seed: int) -> FloatArray:
    """Shares in [0, 1), (points, paths): one in each of `count` equal slices of each path's range."""
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(paths, rng=seed).random(count), np.float64)


def _at(vary: Vary, share: float, whole: bool) -> Any:
    """The value at a share of the way: of whole numbers and of lists each item has an equal part of it."""
    of = vary.values
    if not isinstance(of, Range):
        return of[int(share * len(of))]
    if of.count is not None:
        raise vary.refused("expected FIRST:LAST without COUNT: --points says how many")
    if not whole:
        return of.at(Fraction(share))
    if of.log:
        return floor(of.at(Fraction(share)) + 0.5)
    low, high = sorted((floor(of.first + Fraction(1, 2)), floor(of.last + Fraction(1, 2))))
    return low + int(share * (high - low + 1))


def _point(varied: Sequence[Vary], values: Sequence[Any]) -> Point:
    return {vary.path: value for vary, value in zip(varied, values, strict=True)}
