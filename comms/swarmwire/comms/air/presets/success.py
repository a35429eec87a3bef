"""Success tables of modulations that have no receiver of their own here, as a scenario writes them."""

import math
from collections.abc import Callable
from typing import Any

STEP_DB = 0.5
DIGITS = 9  # a bit in a billion more or less is none in a frame


def fsk_success() -> dict[str, Any]:
    """A bit by binary FSK, received without its phase: bit errors 0.5 exp(-SINR / 2) (Proakis, Digital Communications).

    GFSK with Bluetooth's deviation is no better; a bit a symbol in a bandwidth of the bit rate, so that SINR is Eb/N0.
    """
    return _table(0.0, 18.0, 1, lambda sinr: 1.0 - 0.5 * math.exp(-0.5 * sinr))


def qpsk_success_of_bytes() -> dict[str, Any]:
    """A byte as the simulators gz and SubT have it: erfc(sqrt(SINR)) is the loss of a byte, not of a bit."""
    return _table(-10.0, 15.0, 8, lambda sinr: 1.0 - math.erfc(math.sqrt(sinr)))


def _table(least_db: float, most_db: float, bits: int, success: Callable[[float], float]) -> dict[str, Any]:
    rows = round((most_db - least_db) / STEP_DB) + 1
    sinr_db = [least_db + STEP_DB * row for row in range(rows)]
    found = [round(success(10.0 ** (0.1 * db)), DIGITS) for db in sinr_db]
    return {"sinr_db": sinr_db, "success": found, "frame_bits": bits}
