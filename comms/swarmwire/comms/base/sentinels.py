"""Integers that mark the absence of a value. Comparisons name them, never their number.

Those of the first block are on the wire and in files; some share a number. Those of the other blocks are all distinct,
so that two of them never match.
"""

NO_ROBOT = -1  # no robot row or index; as a receiver: all intended receivers without a row of their own
BROADCAST = -1  # `to` of a packet for all other robots of the arena that are alive when it is sent
NOWHERE = -2  # `to` of a packet for an address of no robot: it goes on air without a receiver or an acknowledgement
NO_TX_STATUS = -1  # the tx status id of a packet whose sender wants no status
NO_TAG = -1  # the tag of a payload too short to have one, and of the base class of messages
NO_TICK = -1  # no tick: before the first, or of a frame that concerns none
NO_SERIAL = -1  # serial of an event that is not from the scenario

NO_PACKET = -3  # no row of a table of packets
ABSENT = -4  # no index: the table lacks the item

# In place of a `Fate`. Both are far below 0, so that one used as the index of a fate fails instead of wrapping around,
# and fit in an 8-bit column.
UNDER_WAY = -100  # a packet, or a link, whose fate is not decided yet
NO_FATE = -101  # no attempt at the packet has had a fate at its receiver
