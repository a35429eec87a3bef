"""Fates: what may become of a packet for one intended receiver."""

from swarmwire.comms.packets import Fate
from swarmwire.deploy.catalogue.entry import Entry


def fates() -> list[Entry]:
    """All fates, in the order of the tally's columns."""
    return [
        Entry(
            kind="fate",
            name=fate.name.lower(),
            help=fate.meaning,
            facts=(("in summary.json", f"radio.fates.{fate.name.lower()}: intended receivers; all fates add up"),),
        )
        for fate in Fate
    ]
