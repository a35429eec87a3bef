"""Propagation: what is left of a signal at the receiver's antenna. One effect a file; losses in dB."""
