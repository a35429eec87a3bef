"""Stages of the radio: what a packet passes on its way to a receiver. One file each, in the order of `chain.py`."""
