"""Frame exchanges of IEEE 802.11n: aggregation, block acknowledgements, RTS and CTS, and rate control.

`events.run_until` takes the place of `mac.run_until`; other radios do not compile this folder. Channel access is that
of `dcf.py` with AIFS.
"""
