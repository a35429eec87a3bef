"""Sine and cosine at once, by + - * alone: equal bit for bit on every machine, and quicker than the library. Compiled.

The angle is brought to within an eighth of a turn by taking off quarters (Cody and Waite), where polynomials are right
to the last bit or two: S. Moshier, Cephes mathematical library (1984-2000), sin.c and cos.c.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import borrowing

QUARTERS_PER_RAD = 2.0 / np.pi
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi / 2; the first has 33 bits


@borrowing(from_python=True)
def sine_cosine(angle_rad):
    """The sine and the cosine of an angle up to some 1e6 rad, within 2e-16."""
    quarters = np.floor(angle_rad * QUARTERS_PER_RAD + 0.5)
    r = (angle_rad - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    z = r * r
    sine = r + r * z * _polynomial(
        z,
        -1.66666666666666307295e-1,
        8.33333333332211858878e-3,
        -1.98412698295895385996e-4,
        2.75573136213857245213e-6,
        -2.50507477628578072866e-8,
        1.58962301576546568060e-10,
    )
    cosine = (
        1.0
        - 0.5 * z
        + z
        * z
        * _polynomial(
            z,
            4.16666666666665929218e-2,
            -1.38888888888730564116e-3,
            2.48015872888517045348e-5,
            -2.75573141792967388112e-7,
            2.08757008419747316778e-9,
            -1.13585365213876817300e-11,
        )
    )
    quarter = int(quarters) & 3
    if quarter & 1:
        sine, cosine = cosine, -sine
    return (-sine, -cosine) if quarter & 2 else (sine, cosine)


@borrowing()
def _polynomial(z, a, b, c, d, e, f):
    return a + z * (b + z * (c + z * (d + z * (e + z * f))))
