"""Integers that stand for the absence of something, each with its meaning. Comparisons name them, never their value.

The first ones are on the wire and in files, where several share a value. The others have values of their own, so that
one that is compared with another never matches.
"""

NO_ROBOT = -1  # in place of a robot row or index; as a receiver: all intended receivers of the packet
BROADCAST = -1  # `to` of a packet for every robot within reach
NOWHERE = -2  # `to` of a packet for an address of no robot: it goes on air, and nobody receives or acknowledges it
NO_TX_STATUS = -1  # the tx status id of a packet whose sender wants no status
NO_TAG = -1  # the tag of a payload too short to have one

NO_PACKET = -3  # in place of a row in a table of packets
ABSENT = -4  # in place of an index in a table that lacks the item

# In place of a `Fate`. Both are far below the numbers of fates, so that no array of counts takes one for an index from
# its end, and fit in an 8-bit column.
UNDER_WAY = -100  # a packet, or a link, whose fate is not decided yet
NO_FATE = -101  # no attempt at the packet has had a fate at its receiver
