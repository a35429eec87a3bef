"""How late packets were."""

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import Static
from swarmwire.metrics.report.run_data import RunData
from swarmwire.metrics.report.run_figures.latency_histogram import latency_histogram
from swarmwire.metrics.report.section import Figure
from swarmwire.metrics.report.svg import as_svg

COLUMNS = ("receiver", "fate", "sent_at_ns", "final_at_ns")


def latencies(run: RunData) -> Figure | str:
    """The figure, or why there is none."""
    packets = run.packets(COLUMNS)
    if isinstance(packets, str):
        return f"Latencies of single packets: {packets}"
    received = packets.filter(packets["fate"].cast(str) == FATE_NAMES[Fate.RECEIVED])
    if not len(received):
        return "Latencies: no packet was received."
    receiver, _, sent_ns, final_ns = (received[name] for name in COLUMNS)
    sent = sent_ns.to_numpy()
    final = final_ns.to_numpy()
    acts = acts_at_ns(final, receiver.to_numpy(), run.static)
    figure = latency_histogram((final - sent) / NS_PER_S, (acts - sent) / NS_PER_S)
    caption = (
        "Latency of packets that were received: from sending to hearing, and to the first tick at which the receiver "
        "acts. Lines are p50, p90 (dashed) and p99 (dotted)."
    )
    recorded = run.record("packets").get("share", 1.0)
    if recorded < 1.0:
        caption += f" A share of {recorded:g} of the packets was recorded."
    return Figure("latency", as_svg(figure, "latency"), caption)


def acts_at_ns(final_at_ns: IntArray, receiver: IntArray, static: Static) -> IntArray:
    """When the receivers (k,) could act on what they received at times (k,), in ns: at their next tick."""
    tick = -(-final_at_ns * static.rate_hz // NS_PER_S)
    every = static.act_every_ticks[receiver]
    return -(-tick // every) * every * NS_PER_S // static.rate_hz
