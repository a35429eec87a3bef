"""How a recording looks when it is opened: the arena on the left, plots on the right, panels out of the way."""

from typing import Any

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.truth import Static

TRAIL_S = 5.0
_MARGIN = 1.03  # of the arena's half width, so that its walls are seen
_TICK, _TIME = "tick", "sim_time"


def layout(static: Static) -> Any:
    """The blueprint for recordings of this run; without a radio it has no plot of packets."""
    import rerun.blueprint as rrb

    plots = [
        _plot("shares", "Order and connectivity, as shares", (-0.03, 1.03)),
        _plot("distances", "Distances in m"),
        _plot("numbers", "Counts"),
    ]
    if static.range_m is not None:
        plots.insert(1, _plot("packets", "Packets per second, over the last second"))
    return rrb.Blueprint(
        rrb.Horizontal(_arena(static), rrb.Vertical(*plots), column_shares=[1.7, 1.0]),
        rrb.TopPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=_TIME, play_state="playing"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _arena(static: Static) -> Any:
    import rerun.blueprint as rrb

    half_x, half_y = (_MARGIN * size / 2 for size in static.arena_size_m)
    return rrb.Spatial2DView(
        origin="/",
        contents=["/world/**"],
        name="Arena",
        background=[16, 18, 24],
        visual_bounds=rrb.VisualBounds2D(x_range=[-half_x, half_x], y_range=[-half_y, half_y]),
        overrides={"/world/trails": [_last(TRAIL_S, static.rate_hz)]},
    )


def _last(duration_s: float, rate_hz: int) -> Any:
    """What was logged in the last seconds before the cursor, whichever timeline is shown."""
    import rerun.blueprint as rrb

    since, now = -round(duration_s * NS_PER_S), rrb.TimeRangeBoundary.cursor_relative
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(_TICK, start=now(seq=-round(duration_s * rate_hz)), end=now(seq=0)),
            rrb.VisibleTimeRange(_TIME, start=now(nanos=since), end=now(nanos=0)),
        ]
    )


def _plot(entity: str, name: str, bounds: tuple[float, float] | None = None) -> Any:
    import rerun.blueprint as rrb

    always = rrb.TimeRangeBoundary.infinite()  # else the viewer shows no more than a minute around the cursor
    return rrb.TimeSeriesView(
        origin=f"/plots/{entity}",
        name=name,
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=always, end=always)),
        axis_y=rrb.ScalarAxis(range=bounds) if bounds else None,
        plot_legend=rrb.Corner2D.LeftTop if entity == "numbers" else rrb.Corner2D.RightBottom,
    )
