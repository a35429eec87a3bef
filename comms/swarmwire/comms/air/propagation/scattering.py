"""Scattering: waves that arrive over many paths add up or cancel, and a fraction of a wavelength decides.

The power gain g of a link (E g = 1) is that of a sum of N plane waves in the positions of both its robots,

    h = 1/sqrt(N) sum_n exp(2 pi i (u_n . x_a / lambda + v_n . x_b / lambda + phase_n)),     g = |h|^2,

with unit vectors u_n and v_n all around either robot (Clarke, Bell Syst. Tech. J. 47, 1968; for two that move: Akki and
Haber, IEEE Trans. Vehicular Techn. 35, 1986). So no link has a state, both directions agree, a packet's gain does not
depend on what was sent before, and while one end moves by s, h is correlated by J0(2 pi s / lambda), Jakes' spectrum;
while both move, by the product.

The directions are a lattice of N points over both circles, which keyed amounts turn around either robot; the phases are
keyed, too, all by the arena's key and the unordered pair of indices in it. |h|^2 is exponential but for O(1/N):
E g^2 = 2 - 1/N, its distribution is within 0.004 of the exponential's, and it is never above N (15 dB).
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.propagation.waves import cosine, sine, total
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform

WAVES, GENERATOR = 32, 19  # v's index is GENERATOR x u's: near the golden section, and without common divisor
PHASES_PER_DRAW, PHASE_STEPS = 3, 2**17  # a draw's 51 leading bits are three phases
FADING = purpose("fading")
_N = np.arange(WAVES)
_COS_U, _SIN_U = np.cos(2.0 * np.pi * _N / WAVES), np.sin(2.0 * np.pi * _N / WAVES)
_COS_V, _SIN_V = _COS_U[_N * GENERATOR % WAVES], _SIN_U[_N * GENERATOR % WAVES]


@njit(cache=True)
def scattered(key, a, b, wave_number, ax, ay, bx, by):
    """Real and imaginary part of h for robots a < b (indices in the arena) at (ax, ay) and (bx, by) in m.

    `wave_number` is 1 / lambda in cycles per m. About 0.4 us.
    """
    phase = np.empty(WAVES)
    for i in range(0, WAVES, PHASES_PER_DRAW):
        draw = uniform(key, a, b, 2 + i, FADING)
        for n in range(i, min(i + PHASES_PER_DRAW, WAVES)):
            draw *= PHASE_STEPS
            phase[n] = math.floor(draw) / PHASE_STEPS
            draw -= math.floor(draw)
    # The directions turn with the circle around each robot, so its position turns the other way.
    ux, uy = _turned(ax * wave_number, ay * wave_number, uniform(key, a, b, 0, FADING))
    vx, vy = _turned(bx * wave_number, by * wave_number, uniform(key, a, b, 1, FADING))
    real, imaginary = np.empty(WAVES), np.empty(WAVES)
    _waves(ux, uy, vx, vy, phase, real, imaginary)
    scale = 1.0 / math.sqrt(WAVES)
    return total(real) * scale, total(imaginary) * scale


@njit(cache=True)
def _turned(x, y, turns):
    c, s = cosine(turns), sine(turns)
    return c * x + s * y, c * y - s * x


@njit(cache=True, error_model="numpy")
def _waves(ux, uy, vx, vy, phase, real, imaginary):
    for n in range(len(phase)):
        at = _COS_U[n] * ux + _SIN_U[n] * uy + _COS_V[n] * vx + _SIN_V[n] * vy + phase[n]
        real[n], imaginary[n] = cosine(at), sine(at)
