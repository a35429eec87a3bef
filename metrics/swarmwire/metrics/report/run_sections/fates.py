"""What became of packets, and how late those were that arrived, in numbers: of each arena, or of all together."""

from typing import Any

from swarmwire.comms.packets import Fate
from swarmwire.metrics.network.radio_tally import PERCENTS
from swarmwire.metrics.report.in_words import number, share
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.report.section import Table

_LATENCIES = {"latency_air_s": "on air", "latency_agent_s": "to the agent"}


def fates(run: RunData) -> list[str | Table]:
    """The tables, from the summary; without one a line that says so."""
    if run.summary is None:
        return ["What became of packets in all is counted at the end of a run, which this one has not reached."]
    arenas = [found for arena in range(run.static.arenas) if (found := run.of_arena("radio", arena))]
    if not arenas:
        return []
    return [_fates(arenas), _latencies(arenas[0], len(arenas))]


def _fates(arenas: list[dict[str, Any]]) -> Table:
    intended = sum(one["intended"] for one in arenas)
    counted = {fate: sum(one["fates"].get(fate.name.lower(), 0) for one in arenas) for fate in Fate}
    rows = tuple(
        (fate.name.lower().replace("_", " "), f"{packets:,}", share(packets / intended), fate.meaning)
        for fate, packets in counted.items()
        if packets
    )
    of = f" in {len(arenas)} arenas together" if len(arenas) > 1 else ""
    caption = f"Fates of packets{of}, one for each receiver that a packet was meant for; they add up to {intended:,}."
    return Table(("fate", "receivers", "share", "meaning"), rows, caption)


def _latencies(radio: dict[str, Any], arenas: int) -> Table:
    percents = tuple(f"p{percent:g}" for percent in PERCENTS)
    rows = tuple(
        (name, *(_ms(radio[key][percent]) for percent in percents)) for key, name in _LATENCIES.items() if key in radio
    )
    of = ", of the first arena" if arenas > 1 else ""
    return Table(
        ("latency", *(f"{percent} in ms" for percent in percents)), rows, f"Latencies of all packets received{of}."
    )


def _ms(value_s: float | None) -> str:
    return number(None if value_s is None else 1e3 * value_s)
