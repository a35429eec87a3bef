"""The layout of a recording: the arena in the middle, explanations at the left, plots at the right."""

from typing import Any, Literal

import rerun.blueprint as rrb

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.pictures.viewer.selection import ARENA, EYE, close_up_m
from swarmwire.metrics.pictures.viewer.style import KEY_LINES, LEGEND_LINES, printable

TRAIL_S = 5.0
_MARGIN = 1.03  # half width of the view relative to the arena's, with room for its walls
_TICK, _TIME = "tick", "sim_time"
_ARENA_SHARE = 0.44  # share of the window's width for a square arena; plots are wider next to a narrow one
_MIN_ARENA_SHARE, _SIDE_SHARE = 0.24, 0.19
_NARROW = 0.6  # arenas with a smaller ratio of width to height have the window's full height
_PAGE_ARENA_SHARE = 0.64
_ROWS = [4.2, 1.0]  # heights of the views and of the events below them
_PAGE_ROWS = [1.0, 2.2]  # heights of the close-up and of a plot with its key
_KEY_SHARES, _PLOT_SHARES = [1.3, 1.0], [2.2, 1.0]  # sizes of a plot and of its key, below or next to the plot
_SHARES = (-0.03, 1.08)  # bounds of the axis of shares


def layout(static: Static, selected: str, play_state: Literal["playing", "following", "paused"] = "playing") -> Any:
    """Return the blueprint for recordings of a run, with a close-up of the selected robot.

    `play_state` is "following" for a live run. Without a radio there is no plot of packets.
    """
    aspect = static.arena_size_m[0] / static.arena_size_m[1]
    arena_share = _ARENA_SHARE * min(max(aspect, _MIN_ARENA_SHARE / _ARENA_SHARE), 1.0)
    side = rrb.Vertical(_legend(), _close_up(static, selected), _about(), row_shares=[0.5, 1.2, 1.2])
    plots = rrb.Vertical(*_plots(static))
    if aspect < _NARROW:
        middle, right = _arena(static), rrb.Vertical(plots, _events(), row_shares=_ROWS)
    else:
        middle, right = rrb.Vertical(_arena(static), _events(), row_shares=_ROWS), plots
    shares = [_SIDE_SHARE, arena_share, 1.0 - _SIDE_SHARE - arena_share]
    return _blueprint(rrb.Horizontal(side, middle, right, column_shares=shares), play_state)


def page_layout(static: Static, selected: str) -> Any:
    """Return the blueprint for the web page, which shows numbers and events itself: a large arena.

    It shows a single plot at a time, with its key below, since the window may be that of a phone.
    """
    packets = [] if static.range_m is None else [_plot_above_key("packets", "Packets")]
    tabs = rrb.Tabs(_plot_above_key("shares", "Shares", _SHARES), *packets, active_tab=0)
    right = rrb.Vertical(_close_up(static, selected), tabs, row_shares=_PAGE_ROWS)
    shares = [_PAGE_ARENA_SHARE, 1.0 - _PAGE_ARENA_SHARE]
    return _blueprint(rrb.Horizontal(_arena(static), right, column_shares=shares))


def _blueprint(views: Any, play_state: Literal["playing", "following", "paused"] = "following") -> Any:
    return rrb.Blueprint(
        views,
        rrb.TopPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=_TIME, play_state=play_state),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _arena(static: Static) -> Any:
    half_x, half_y = (_MARGIN * size / 2 for size in static.arena_size_m)
    return rrb.Spatial2DView(
        origin="/",
        contents=["/world/**"],
        name="Arena",
        visual_bounds=rrb.VisualBounds2D(x_range=[-half_x, half_x], y_range=[-half_y, half_y]),
        overrides={"/world/trails": [_last(TRAIL_S, static.rate_hz)]},
    )


def _close_up(static: Static, selected: str) -> Any:
    half_m = close_up_m(static, selected)
    return rrb.Spatial2DView(
        origin=f"/{EYE}",
        contents=["/world/**", "- /world/trails", "- /world/links", "- /world/lost_packets", "- /world/traffic"],
        name="Selected robot",
        visual_bounds=rrb.VisualBounds2D(x_range=[-half_m, half_m], y_range=[-half_m, half_m]),
    )


def _legend() -> Any:
    return _names("/legend", "Robots", LEGEND_LINES)


def _names(origin: str, name: str, lines: int, **look: Any) -> Any:
    half = lines / 2
    bounds = rrb.VisualBounds2D(x_range=[-half, half], y_range=[-0.5, lines])
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds, **look)


def _key(entity: str, name: str) -> Any:
    return _names(f"/keys/{entity}", f"{name}: lines", KEY_LINES, titlebar=False)


def _plot_above_key(entity: str, name: str, bounds: tuple[float, float] | None = None) -> Any:
    plot = _lines(entity, name, bounds, titlebar=False)  # the tab shows the name
    return rrb.Vertical(plot, _key(entity, name), row_shares=_KEY_SHARES, name=name)


def _plot_with_key(entity: str, name: str, bounds: tuple[float, float] | None = None) -> Any:
    return rrb.Horizontal(_lines(entity, name, bounds), _key(entity, name), column_shares=_PLOT_SHARES, name=name)


def _about() -> Any:
    return rrb.TextDocumentView(origin="/about", name="About")


def _events() -> Any:
    columns = rrb.TextLogColumns(timeline_columns=[_TIME], text_log_columns=["Body"])
    return rrb.TextLogView(origin="/events", name="Events", columns=columns)


def _plots(static: Static) -> list[Any]:
    shares = _plot_with_key("shares", "Order and connectivity, as shares", _SHARES)
    distances, numbers = _plot_with_key("distances", "Distances in m"), _plot_with_key("numbers", "Counts")
    if static.range_m is None:
        return [shares, distances, numbers]
    packets = _plot_with_key("packets", "Receivers per second, by a packet's fate")
    times, rates = _plot_with_key("times", "Times in s"), _plot_with_key("rates", "Rates in bit/s")
    first, second = (distances, numbers) if any(static.lights) else (numbers, distances)
    return [shares, packets, rrb.Tabs(first, second, times, rates, active_tab=0)]


def _last(duration_s: float, rate_hz: int) -> Any:
    """Return the range of the last seconds before the cursor, on both timelines."""
    since, now = -round(duration_s * NS_PER_S), rrb.TimeRangeBoundary.cursor_relative
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(_TICK, start=now(seq=-round(duration_s * rate_hz)), end=now(seq=0)),
            rrb.VisibleTimeRange(_TIME, start=now(nanos=since), end=now(nanos=0)),
        ]
    )


def _lines(entity: str, name: str, bounds: tuple[float, float] | None, **look: Any) -> Any:
    """Return a plot without rerun's legend, which would cover its lines."""
    always = rrb.TimeRangeBoundary.infinite()  # the viewer's default is a minute around the cursor
    return rrb.TimeSeriesView(
        origin=f"/plots/{entity}",
        name=name,
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(start=always, end=always)),
        axis_y=rrb.ScalarAxis(range=bounds) if bounds else None,
        plot_legend=rrb.PlotLegend(visible=False),
        **look,
    )


def about(static: Static, selected: str, links_every_ticks: int) -> str:
    """Return Markdown on the run and its picture."""
    size = " × ".join(f"{side:.3g}" for side in static.arena_size_m)
    groups = ", ".join(f"{group.stop - group.start} × {group.body.name} ({group.name})" for group in static.groups)
    lines = [
        f"**{static.name}**, seed {static.seeds[ARENA]}",
        "",
        f"{groups} in {size} m, {static.rate_hz} ticks per second",
        "",
        " ".join(["The ring and the name mark the selected robot.", *_drawn(static, selected)]),
    ]
    if static.range_m is not None:
        interval = "" if links_every_ticks == 1 else f" (every {links_every_ticks} ticks)"
        lines += [
            "",
            f"The radio reaches {static.range_m:.3g} m: the large circle. Grey lines join robots in reach; "
            f"coloured ones are packets that were not received{interval}, in the colour of their fate in the plot of "
            "packets.",
        ]
    return "\n".join(printable(line) for line in lines)


def _drawn(static: Static, selected: str) -> list[str]:
    """Return sentences on the sensors of the selected robot that the recording shows."""
    index = static.robot_names.index(selected)
    body = next(group.body for group in static.groups if group.start <= index < group.stop)
    rays = ["Its rays: red meets a robot, grey a wall or an obstacle, faint nothing."] if body.proximity else []
    return [*rays, "Yellow bars: light."] if body.light else rays
