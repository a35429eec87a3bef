"""What the radio did: delivery over distance, latencies, links, and what became of packets."""

import shlex
from typing import Any

from swarmwire.metrics.report.in_words import share
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.report.run_sections.distances import distances
from swarmwire.metrics.report.run_sections.fates import fates
from swarmwire.metrics.report.run_sections.latencies import latencies
from swarmwire.metrics.report.run_sections.links import links
from swarmwire.metrics.report.section import Figure, Listing, Section

TITLE = "The radio"


def radio(run: RunData) -> Section:
    """The section: figures side by side, then what is to be said of those that cannot be drawn, then tables."""
    if not run.has_radio:
        return Section(TITLE, ("The robots have no radio.",))
    found = run.of_arena("radio")
    said = [_account(found, run.static.arenas)] if found else []
    drawn = [distances(run), latencies(run), links(run)]
    figures = [part for part in drawn if isinstance(part, Figure)]
    missing = [part for part in drawn if isinstance(part, str)]
    if missing and run.started:
        missing.append("A repetition records it, and is the same run:")
        again = Listing(f"swarmwire repeat {run.shown_name} --packets all --links --out {_again(run)}")
        return Section(TITLE, (*said, *figures, *missing, again, *fates(run)))
    return Section(TITLE, (*said, *figures, *missing, *fates(run)))


def _again(run: RunData) -> str:
    return shlex.quote(f"{run.folder.path.resolve().name}-again")


def _account(radio: dict[str, Any], arenas: int) -> str:
    sent, intended, in_range = radio["sent"], radio["intended"], radio["in_range"]
    where = "In the first arena " if arenas > 1 else ""
    reached = f"meant for {intended:,} receivers{_ratio('pdr', radio['pdr'])}, of which {in_range:,} were in range"
    return f"{where}{sent:,} packets were sent, {reached}{_ratio('link_pdr', radio['link_pdr'])}."


def _ratio(name: str, ratio: float | None) -> str:
    return "" if ratio is None else f" ({name} {share(ratio)})"
