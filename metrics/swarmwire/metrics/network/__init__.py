"""Metrics of the network: what became of packets, and how the radio graph holds together."""
