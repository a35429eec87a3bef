"""What the drivers and the gateways of a kind of robot share: packets, keys, and conversions of units."""
