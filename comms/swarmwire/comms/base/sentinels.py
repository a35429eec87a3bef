"""Integers that stand for the absence of something, each with its meaning. Comparisons name them, never their value."""

NO_ROBOT = -1  # in place of a robot row or index; as a receiver: all intended receivers of the packet
BROADCAST = -1  # `to` of a packet for every robot within reach
NOWHERE = -2  # `to` of a packet for an address of no robot: it goes on air, and nobody receives or acknowledges it
NO_TX_STATUS = -1  # the tx status id of a packet whose sender wants no status
