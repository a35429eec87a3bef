"""The protocols of real robots, shared by drivers and gateways: packets, keys and conversions of units."""
