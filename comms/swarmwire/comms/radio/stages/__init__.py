"""Stages of a packet on its way to a receiver: blocking, losses, measurements and delays."""
