"""The emulated radio: the medium that carries every packet, in one of two models."""
