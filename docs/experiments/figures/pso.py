"""Particle swarm search by radio range, loss and latency: robots against point particles."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from docs.experiments.figures._pso import (
    FIRST,
    HALF,
    LIMIT_S,
    Kind,
    against_model,
    at,
    digested,
    distance_curves,
    panels,
    share_curve,
    time_curve,
    times,
    times_by,
    values,
    variants_table,
)
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SMALL_PT, SOFT, Look

__all__ = ["CAMPAIGNS", "COLUMNS", "digested", "draw", "numbers"]

CAMPAIGNS = (
    "pso-range",
    "pso-range-model",
    "pso-loss",
    "pso-loss-model",
    "pso-latency",
    "pso-latency-model",
    "pso-latency-places",
    "pso-ring",
    "pso-inertia",
)
COLUMNS = (HALF,)
RING, KEEPS, INERTIA = (f"robots.particles.params.{name}" for name in ("ring_count", "keeps_received", "inertia"))
SHOWN_M = (1.0, 2.0, 4.0)  # ranges whose distances are drawn
REACHES = ((2.0, "--", "2 m"), (12.0, "-", "all"))  # at which loss and latency are tried
KINDS = (Kind("", "robots", CURVE), Kind("-model", "particles", ACCENT), Kind("-places", "robots with places", SOFT))
PANELS = (
    ("share of the swarms that find the light", "radio range, m"),
    ("median time to half the robots there, s", "radio range, m"),
    ("mean distance to the light, m", "time, s"),
    ("median time to half there, s", "packet loss"),
    ("the same; grey: robots with places", "latency, s"),
    ("neighbours on a ring: median time, s", "packet loss"),
)


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """Six panels: found by range, how soon, how near; how soon by loss, by latency, and on a ring."""
    figure, axes = panels(PANELS)
    _by_range(axes[0], axes[1], runs)
    _approach(axes[2], runs)
    _by_radio(axes[3], runs, "pso-loss", "radio.loss")
    _by_radio(axes[4], runs, "pso-latency", "radio.latency_s")
    _on_ring(axes[5], runs["pso-ring"])
    for each in (axes[1], *axes[3:]):
        each.set_ylim(0.0, LIMIT_S * 1.03)
    for each, where in ((axes[0], "lower right"), (axes[3], "upper left"), (axes[5], "upper left")):
        each.legend(fontsize=SMALL_PT, frameon=False, loc=where)
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """Tables by range, by loss and by latency, the latter two at each reach; robots alone where there is no model."""
    by_range = against_model(runs["pso-range"], runs["pso-range-model"], "radio.range_m", "range, m")
    parts = [f"By radio range:\n\n{by_range}"]
    for name, column, called in (("pso-loss", "radio.loss", "loss"), ("pso-latency", "radio.latency_s", "latency, s")):
        for range_m, _, reach in REACHES:
            kinds = [kind for kind in KINDS if f"{name}{kind.suffix}" in runs]
            selected = [at(runs[f"{name}{kind.suffix}"], radio__range_m=range_m) for kind in kinds]
            title = f"By {called}, radio to {reach}"
            if len(selected) > 1 and kinds[1].suffix == "-model":
                parts.append(f"{title}:\n\n{against_model(selected[0], selected[1], column, called)}")
            else:
                parts.append(f"{title}, robots:\n\n{variants_table(selected[0], {column: called})}")
    if "pso-latency-places" in runs:
        columns = {"radio.range_m": "range, m", "radio.latency_s": "latency, s"}
        parts.append(f"Robots that know their places:\n\n{variants_table(runs['pso-latency-places'], columns)}")
    ring = {RING: "on the ring (0: all)", KEEPS: "keeps what it received", "radio.loss": "loss"}
    parts.append(f"Neighbours on a ring, robots:\n\n{variants_table(runs['pso-ring'], ring)}")
    parts.append(f"Inertia, all hear all, robots:\n\n{variants_table(runs['pso-inertia'], {INERTIA: 'w, a = b = 2'})}")
    return "\n\n".join(parts)


def _by_range(shares: Any, soon: Any, runs: Mapping[str, pl.DataFrame]) -> None:
    """How many find the light, and how soon."""
    ranges = values(runs["pso-range"], "radio.range_m")
    for kind in KINDS[:2]:
        by_range = [at(runs[f"pso-range{kind.suffix}"], radio__range_m=range_m) for range_m in ranges]
        half, first = ([times(each, response) for each in by_range] for response in (HALF, FIRST))
        share_curve(shares, ranges, half, kind.look)
        few: Look = {**kind.look, "ls": ":", "lw": 0.9, "ms": 2, "label": f"{kind.label}: the first"}
        share_curve(shares, ranges, first, few)
        time_curve(soon, ranges, half, kind.look)
    shares.set_ylim(0.0, 1.03)
    for axes in (shares, soon):
        axes.set_xscale("log", base=2)
        axes.set_xticks(ranges, [f"{range_m:g}" for range_m in ranges])
        axes.minorticks_off()


def _approach(axes: Any, runs: Mapping[str, pl.DataFrame]) -> None:
    """How near they come, over time; dotted: point particles."""
    shown = [range_m for range_m in SHOWN_M if range_m in values(runs["pso-range"], "radio.range_m")]
    for kind, style in zip(KINDS[:2], ("-", ":"), strict=True):
        distance_curves(axes, runs[f"pso-range{kind.suffix}"], shown, {"ls": style, "lw": 1.3})
    axes.set_ylim(0.0)


def _by_radio(axes: Any, runs: Mapping[str, pl.DataFrame], campaign: str, column: str) -> None:
    """How soon half of them are there; dashed: with a radio to 2 m."""
    for kind in KINDS:
        for range_m, style, reach in REACHES if f"{campaign}{kind.suffix}" in runs else ():
            selected = at(runs[f"{campaign}{kind.suffix}"], radio__range_m=range_m)
            look: Look = {**kind.look, "ls": style, "label": f"{kind.label}, {reach}"}
            time_curve(axes, *times_by(selected, column), look)


def _on_ring(axes: Any, runs: pl.DataFrame) -> None:
    """How soon half of them are there; dashed: what was received counts until the next update."""
    for count, label, color in ((0, "all", CURVE), (10, "ring", ACCENT)):
        for keeps, style, how in ((True, "-", "kept"), (False, "--", "asked anew")):
            selected = runs.filter((pl.col(RING) == count) & (pl.col(KEEPS) == keeps))
            look: Look = {**Kind("", f"{label}, {how}", color).look, "ls": style}
            time_curve(axes, *times_by(selected, "radio.loss"), look)
