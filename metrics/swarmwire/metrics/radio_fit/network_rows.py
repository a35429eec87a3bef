"""A network's fit as rows for people."""

from collections.abc import Iterator

from swarmwire.metrics.radio_fit.fit_rows import Row, loss_rows
from swarmwire.metrics.radio_fit.network_fit import NetworkFit


def network_rows(fit: NetworkFit) -> Iterator[Row]:
    """Every parameter, fitted or left out."""
    if isinstance(fit.range, str):
        yield Row("range", None, "", fit.range)
    else:
        yield Row("range" if fit.range.reached else "range, at least", fit.range.range_m, "m")
    yield from loss_rows(fit.losses, fit.sequences.interval_s)
    if isinstance(fit.latency, str):
        yield Row("latency", None, "", fit.latency)
        return
    delays = fit.latency.delays
    if delays is not None:
        yield Row("latency", delays.latency_s, "s")
        yield Row(f"{delays.distribution} delay, mean", delays.mean_s, "s")
        yield Row(f"{delays.distribution} delay, deviation", delays.deviation_s, "s")
        return
    yield Row("latency", fit.latency.latency_s, "s")
    yield Row("jitter", fit.latency.jitter_s, "s")
