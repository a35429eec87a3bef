"""A real network's fit as people read it in a terminal."""

from rich.console import Console

from swarmwire.deploy.radio.fit_report import print_models, print_parameters, titled_table
from swarmwire.metrics.radio_fit.fit import NetworkFit
from swarmwire.metrics.radio_fit.losses import LossFit
from swarmwire.metrics.radio_fit.tables import network_rows

MAX_LINKS = 30  # that are told one by one: the worst


def print_network_fit(fit: NetworkFit, title: str, console: Console) -> None:
    """Parameters with their standard errors, models of loss, links, neighbours, and what may be biased."""
    delivered, links = int((~fit.log.lost).sum()), len(fit.links)
    packets = len(fit.log.lost)
    counts = f"{packets} packet{'s' if packets != 1 else ''} on {links} link{'s' if links != 1 else ''}"
    console.print(f"{title}: {counts}, {delivered} received", soft_wrap=True)
    print_parameters(list(network_rows(fit)), console)
    if isinstance(fit.losses, LossFit):
        print_models(fit.losses, console)
    _print_links(fit, console)
    for name, others in fit.neighbours.items():
        console.print(f"neighbours of {name}: {', '.join(others) or 'none'}", soft_wrap=True)
    for note in fit.notes:
        console.print(f"note: {note}", soft_wrap=True)


def _print_links(fit: NetworkFit, console: Console) -> None:
    shown = sorted(fit.links, key=lambda link: link.pdr)[:MAX_LINKS]
    some = f", the worst {len(shown)} of {len(fit.links)}" if len(shown) < len(fit.links) else ""
    table = titled_table(f"delivery by link{some}", header=True)
    for name in ("from", "to", "packets", "received", "delivery"):
        table.add_column(name, justify="left" if name in {"from", "to"} else "right")
    for link in shown:
        table.add_row(link.sender, link.receiver, str(link.packets), str(link.received), f"{link.pdr:.1%}")
    console.print(table)
