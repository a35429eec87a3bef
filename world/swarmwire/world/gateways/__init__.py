"""Gateways: emulated robots that answer as real ones would; entry points of the group `swarmwire.gateways`."""
