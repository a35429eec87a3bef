"""A network's fit as the scenario's table `[radio]`: a disk with the losses and the delays that were found."""

from typing import Any

from swarmwire.metrics.radio_fit.latency_fit import LatencyFit
from swarmwire.metrics.radio_fit.network_fit import NetworkFit
from swarmwire.metrics.radio_fit.radio_table import loss_table, rounded

EVERYWHERE_M = 1000.0  # where no distance is known: the losses are those of all links, however long
QUICK_BPS = 1_000_000_000  # latencies that were measured hold the time on air, too


def network_table(fit: NetworkFit) -> dict[str, Any]:
    """`{"radio": {...}}` with what could be fitted; nothing but an empty table if that is neither losses nor delays."""
    if isinstance(fit.losses, str) and isinstance(fit.latency, str):
        return {"radio": {}}
    range_m = EVERYWHERE_M if isinstance(fit.range, str) else rounded(fit.range.range_m.value)
    radio: dict[str, Any] = {"model": "unit-disk", "range_m": range_m}
    if isinstance(fit.latency, LatencyFit):
        delays = fit.latency.delays
        radio["latency_s"] = rounded((fit.latency if delays is None else delays).latency_s.value)
        radio["jitter_s"] = rounded(fit.latency.jitter_s.value) if delays is None else 0.0
        radio["bit_rate_bps"] = QUICK_BPS
    radio |= loss_table(fit.losses)
    if isinstance(fit.latency, LatencyFit) and fit.latency.delays is not None:
        delays = fit.latency.delays
        radio["delays"] = {
            "distribution": delays.distribution,
            "mean_s": rounded(delays.mean_s.value),
            "deviation_s": rounded(delays.deviation_s.value),
        }
    if fit.log.has_distances:
        radio["measures"] = {"range": {}, "bearing": {}}
    return {"radio": radio}


def network_comments(fit: NetworkFit) -> list[str]:
    """What whoever reads the table should know."""
    comments: list[str] = []
    if isinstance(fit.range, str):
        comments.append("No distance is known: everybody is within reach, and loss does not depend on distance.")
    elif not fit.range.reached:
        comments.append("range_m is the farthest that was tried: the network may reach farther.")
    if fit.log.has_distances:
        comments.append(
            "gives: the robots had a tracker, which tells range and bearing of what is received; exactly, here."
        )
    if isinstance(fit.latency, LatencyFit):
        comments.append("Latencies hold the time on air, too: bit_rate_bps is so high that it adds nothing.")
    return comments
