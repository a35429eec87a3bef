"""Fates: what may become of a packet for one intended receiver."""

from swarmwire.comms.fates import Fate
from swarmwire.deploy.catalogue.docs import comments_of
from swarmwire.deploy.catalogue.entry import Entry


def fates() -> list[Entry]:
    """All fates, in the order of the tally's columns."""
    comments = comments_of(Fate, Fate.__members__)
    return [
        Entry(
            kind="fate",
            name=fate.name.lower(),
            help=comments.get(fate.name, ""),
            facts=(("in summary.json", f"radio.fates.{fate.name.lower()}: intended receivers; all fates add up"),),
        )
        for fate in Fate
    ]
