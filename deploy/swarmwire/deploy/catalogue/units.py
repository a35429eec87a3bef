"""Units by the end of a name: every name that carries a bare number ends with its unit."""

UNITS = {
    "_per_s": "1/s",
    "_ticks": "ticks",
    "_bytes": "byte",
    "_radps": "rad/s",
    "_mps2": "m/s^2",
    "_mps": "m/s",
    "_bps": "bit/s",
    "_dbm": "dBm",
    "_deg": "deg",
    "_rad": "rad",
    "_mhz": "MHz",
    "_khz": "kHz",
    "_db": "dB",
    "_hz": "Hz",
    "_kg": "kg",
    "_nm": "N m",
    "_ns": "ns",
    "_ms": "ms",
    "_m": "m",
    "_n": "N",
    "_s": "s",
}  # longer ends first


def unit_of(name: str) -> str:
    """The unit that the end of a name tells; empty if it tells none.

    >>> unit_of("turn_gain_per_s"), unit_of("speed_mps"), unit_of("cohesion")
    ('1/s', 'm/s', '')
    """
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
