"""How often and how long signals fade, at full length: level crossings and fade durations of Rayleigh fading."""

import numpy as np
import pytest

from swarmwire.comms.draws import derive_key
from swarmwire.comms.radio.config.phy import Fading
from swarmwire.comms.radio.propagation.fading import fading_gain, fading_model

KEY = np.uint64(derive_key("fading"))
LAW = fading_model(Fading(), 2.44e9)._replace(wave_number=2.44e9 / 299_792_458.0)


def test_a_robots_signal_fades_as_often_and_as_long_as_theory_says():
    """At 1 m/s and 2.44 GHz it falls by 10 dB 5.838 times a second, for 16.3 ms each; over 400 s of 40 pairs.

    Held to 12 %: 2300 fades, which come in runs, give about 3 %, so that is 4 standard errors (1 in 16 000).
    """
    metres = np.arange(0.0, 10.0, 1e-3)
    falls, below = 0, 0
    for a, b in ((pair % 150, 150 + pair // 150) for pair in range(0, 15_000, 375)):
        power = np.array([fading_gain(LAW, KEY, a, b, 3.0, 1.0, x, 2.0 * a) for x in metres])
        deep = power < 0.1
        falls += int(np.sum(deep[1:] & ~deep[:-1]))
        below += int(deep.sum())
    seconds = 40 * 10.0
    assert falls / seconds == pytest.approx(5.838, rel=0.12)
    assert below * 1e-3 / falls == pytest.approx(16.30e-3, rel=0.12)
