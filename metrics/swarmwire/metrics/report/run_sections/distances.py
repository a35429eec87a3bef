"""The delivery ratio over distance."""

from swarmwire.metrics.drawing.delivery_over_distance import received_bins
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.report.run_figures.delivery_by_distance import delivery_by_distance
from swarmwire.metrics.report.section import Figure
from swarmwire.metrics.report.svg import as_svg


def distances(run: RunData) -> Figure | str:
    """The figure, or why there is none."""
    table = run.table("radio_distances")
    if isinstance(table, str):
        killed = " It is written at the end of a run." if run.summary is None else ""
        return f"Delivery over distance: {table}{killed}"
    shown = received_bins(table)
    if not len(shown):
        return "Delivery over distance: no packet went on air."
    caption = (
        "Delivery ratio over distance: of all robots that packets on air were meant for, however far, the share that "
        "received. Bars are 95 % intervals (Wilson), receivers taken as independent."
    )
    every = run.record("radio_distances").get("every", 1)
    if every > 1:
        caption += f" One of {every} packets was counted."
    figure = delivery_by_distance(shown, run.static.range_m)
    return Figure("delivery-by-distance", as_svg(figure, "delivery-by-distance"), caption)
