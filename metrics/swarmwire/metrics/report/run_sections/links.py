"""The delivery ratio of each link, from the table of links or else from packets."""

from typing import TYPE_CHECKING

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.metrics.report.in_words import counted, share
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.report.run_figures.link_histogram import link_histogram
from swarmwire.metrics.report.run_figures.link_matrix import link_matrix
from swarmwire.metrics.report.section import Figure
from swarmwire.metrics.report.svg import as_svg

if TYPE_CHECKING:
    import polars as pl

MAX_SQUARES = 60  # robots that a matrix is drawn of
MIN_PACKETS = 10  # in range, of a link that the histogram counts
NAME = "links"


def links(run: RunData) -> Figure | str:
    """The figure, or why there is none."""
    found = _counted(run)
    if isinstance(found, str):
        return f"Delivery by link: {found}"
    received, in_range = of_links(found, run.static.robots)
    if not in_range.any():
        return "Delivery by link: nobody was in range of anybody."
    link_pdr = np.divide(received, in_range, out=np.full(received.shape, np.nan), where=in_range > 0)
    if run.static.robots <= MAX_SQUARES:
        caption = (
            "Delivery ratio of each link: received, of the packets on air while the receiver was in range and sight."
        )
        return Figure(NAME, as_svg(link_matrix(run.static, link_pdr), NAME), caption)
    told = link_pdr[in_range >= MIN_PACKETS]
    if not len(told):
        return f"Delivery by link: no link had {MIN_PACKETS} packets in range."
    caption = (
        f"Delivery ratios of the {counted(len(told), 'link')} with at least {MIN_PACKETS} packets in range; "
        f"the dashed line is their median, {share(float(np.median(told)))}."
    )
    return Figure(NAME, as_svg(link_histogram(told), NAME), caption)


def _counted(run: RunData) -> "pl.DataFrame | str":
    """Packets by sender, receiver and fate, or why they are not known."""
    import polars as pl

    table = run.table("radio_links")
    if not isinstance(table, str):
        return table
    packets = run.packets(("sender", "receiver", "fate"))
    if isinstance(packets, str):
        recorded = [name for name in ("radio_links", "packets") if run.folder.files(name)]
        return f"{table} {packets}" if recorded else "neither `radio_links` nor `packets` was recorded."
    return packets.group_by("sender", "receiver", "fate").agg(pl.len().alias("packets"))


def of_links(table: "pl.DataFrame", robots: int) -> tuple[IntArray, IntArray]:
    """Of packets by sender, receiver and fate: those received, and those with the receiver in range, (n, n) each.

    In range is as in the radio's account: whatever became of the packet, unless an obstacle was in the way.
    """
    fate = table["fate"].cast(str).to_numpy()
    place = table["sender"].to_numpy(), table["receiver"].to_numpy()
    packets = table["packets"].to_numpy()
    received, in_range = (np.zeros((robots, robots), np.int64) for _ in range(2))
    np.add.at(received, place, np.where(fate == FATE_NAMES[Fate.RECEIVED], packets, 0))
    np.add.at(in_range, place, np.where(fate != FATE_NAMES[Fate.BLOCKED], packets, 0))
    return received, in_range
