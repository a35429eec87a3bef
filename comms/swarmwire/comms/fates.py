"""What may become of a packet for one intended receiver."""

from swarmwire.comms.explained import Explained


class Fate(Explained):
    """One per (packet, intended receiver), with its meaning; the order is that of the tally's columns."""

    HEARD = 0, "reached the receiver"
    OUT_OF_RANGE = 1, "the receiver was out of the radio's reach when the packet went on air"
    BLOCKED = 2, "an obstacle stood in the line of sight"
    LOST = 3, "within reach, but lost by the medium's fixed loss, or a trace's delivery ratio"
    QUEUE_FULL = 4, "the sender's queue was full: never on air"
    TOO_LARGE = 5, "above the medium's largest payload: never on air"
    IN_FLIGHT = 6, "queued or on its way when the run ended"
    SENDER_DEAD = 7, "the sender died before the packet went on air"
    RECEIVER_DEAD = 8, "within reach, but dead when the packet went on air, or before it was handed over"
    BLACKOUT = 9, "the sender's radio was off, or that of a receiver within reach"
    PARTITIONED = 10, "within reach, but a partition kept the two apart when the packet went on air"
    TOO_WEAK = 11, "within reach on average, but too weak for the receiver's noise when the packet was on air"
    COLLIDED = 12, "other packets on air disturbed it, or the receiver was busy with another or sending itself"
    BURST = 13, "lost by a burst, while the link was in its bad state"
    CHANNEL_BUSY = 14, "the sender found the air busy each time it listened: never on air"
    JAMMED = 15, "a jammer drowned it: without it the packet would have been right"


FATE_NAMES = tuple(fate.name.lower() for fate in Fate)  # by number, as summaries and tables have them
