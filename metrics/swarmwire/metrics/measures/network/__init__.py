"""Metrics of the network: the fates of packets, and the connectivity of the radio graph."""
