"""Keyed random draws: the value of a draw depends on its purpose, not on the order of the calls.

One counter-based generator, Philox 4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011):
a draw is a pure function of a 64-bit key (its owner) and four 32-bit counters (its purpose). This is the numpy
form; `draws_compiled` is the numba form, equal bit for bit.
"""

from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swarmwire.comms.base import math
from swarmwire.comms.base.arrays import FloatArray, KeyArray

Words = NDArray[np.uint64]
F = TypeVar("F", float, FloatArray)

MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
WEYL = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10
LOW32 = 0xFFFFFFFF  # the lower half of a key or a number of 64 bits
TO_UNIT = 2.0**-53

# Wichura's AS241 (PPND16), Applied Statistics 37 (1988): numerator and denominator of the three rational pieces.
CENTRE = (
    (
        3.3871328727963666080e0,
        1.3314166789178437745e2,
        1.9715909503065514427e3,
        1.3731693765509461125e4,
        4.5921953931549871457e4,
        6.7265770927008700853e4,
        3.3430575583588128105e4,
        2.5090809287301226727e3,
    ),
    (
        1.0,
        4.2313330701600911252e1,
        6.8718700749205790830e2,
        5.3941960214247511077e3,
        2.1213794301586595867e4,
        3.9307895800092710610e4,
        2.8729085735721942674e4,
        5.2264952788528545610e3,
    ),
)
TAIL = (
    (
        1.42343711074968357734e0,
        4.63033784615654529590e0,
        5.76949722146069140550e0,
        3.64784832476320460504e0,
        1.27045825245236838258e0,
        2.41780725177450611770e-1,
        2.27238449892691845833e-2,
        7.74545014278341407640e-4,
    ),
    (
        1.0,
        2.05319162663775882187e0,
        1.67638483018380384940e0,
        6.89767334985100004550e-1,
        1.48103976427480074590e-1,
        1.51986665636164571966e-2,
        5.47593808499534494600e-4,
        1.05075007164441684324e-9,
    ),
)
FAR_TAIL = (
    (
        6.65790464350110377720e0,
        5.46378491116411436990e0,
        1.78482653991729133580e0,
        2.96560571828504891230e-1,
        2.65321895265761230930e-2,
        1.24266094738807843860e-3,
        2.71155556874348757815e-5,
        2.01033439929228813265e-7,
    ),
    (
        1.0,
        5.99832206555887937690e-1,
        1.36929880922735805310e-1,
        1.48753612908506148525e-2,
        7.86869131145613259100e-4,
        1.84631831751005468180e-5,
        1.42151175831644588870e-7,
        2.04426310338993978564e-15,
    ),
)


def derive_key(*parts: int | str) -> int:
    """Derive a 64-bit key from `parts` one-way (BLAKE2b), so that it does not reveal them."""
    # Plain types, since the text of numpy's scalars differs.
    plain = tuple(str(part) if isinstance(part, str) else int(part) for part in parts)
    digest = blake2b(repr(plain).encode(), digest_size=8, person=b"swarmwire").digest()
    return int.from_bytes(digest, "little")


def purpose(name: str) -> int:
    """Return the 32-bit counter word of a purpose, such as "proximity noise"."""
    return int.from_bytes(blake2b(name.encode(), digest_size=4, person=b"purpose").digest(), "little")


def philox(
    key: ArrayLike, c0: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike
) -> tuple[Words, Words, Words, Words]:
    """Philox 4x32-10: four random 32-bit words per broadcast element, as uint64."""
    return _rounds(*(np.asarray(number, np.uint64) for number in (key, c0, c1, c2, c3)))


def _rounds(key: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> tuple[Any, Any, Any, Any]:
    """Compute Philox of arrays, or of integers without arrays."""
    k0, k1 = key & LOW32, key >> 32
    x0, x1, x2, x3 = c0 & LOW32, c1 & LOW32, c2 & LOW32, c3 & LOW32
    for _ in range(ROUNDS):
        p0, p1 = x0 * MULTIPLIERS[0], x2 * MULTIPLIERS[1]
        x0, x1, x2, x3 = (p1 >> 32) ^ x1 ^ k0, p1 & LOW32, (p0 >> 32) ^ x3 ^ k1, p0 & LOW32
        k0, k1 = (k0 + WEYL[0]) & LOW32, (k1 + WEYL[1]) & LOW32
    return x0, x1, x2, x3


def uniform(key: KeyArray | int, c0: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike) -> FloatArray:
    """Draw uniform numbers in [0, 1) with 53 random bits, one per broadcast element of key and counters."""
    x0, x1, _, _ = philox(key, c0, c1, c2, c3)
    return (((x1 << np.uint64(32)) | x0) >> np.uint64(11)).astype(np.float64) * TO_UNIT


def uniform_one(key: int, c0: int, c1: int, c2: int, c3: int) -> float:
    """Draw one number as `uniform`, without arrays: in a twentieth of the time."""
    x0, x1, _, _ = _rounds(key, c0, c1, c2, c3)
    return ((x1 << 32 | x0) >> 11) * TO_UNIT


def normal(key: KeyArray | int, c0: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike) -> FloatArray:
    """Draw standard normal numbers (inverse CDF, AS241), one per broadcast element of key and counters."""
    # Half a step above zero: the argument stays within (0, 1), so that the logarithm is finite.
    return normal_quantile(uniform(key, c0, c1, c2, c3) + 0.5 * TO_UNIT)


def normal_one(key: int, c0: int, c1: int, c2: int, c3: int) -> float:
    """Draw one number as `normal`; without arrays, but for the outer 15 %."""
    p = uniform_one(key, c0, c1, c2, c3) + 0.5 * TO_UNIT
    q = p - 0.5
    return q * _ratio(CENTRE, 0.180625 - q * q) if abs(q) <= 0.425 else float(normal_quantile(np.asarray(p)))


def normal_quantile(p: FloatArray) -> FloatArray:
    """Return the standard normal quantile of p in (0, 1), by AS241; relative error below 1e-15."""
    q = p - 0.5
    nearest_end = np.where(q < 0.0, p, 1.0 - p)
    # 1 - p may round to zero just below one; the smallest step keeps the logarithm finite.
    root = np.sqrt(-math.log(np.maximum(nearest_end, 0.5 * TO_UNIT)))
    centre = q * _ratio(CENTRE, 0.180625 - q * q)
    tail = np.where(root <= 5.0, _ratio(TAIL, root - 1.6), _ratio(FAR_TAIL, root - 5.0))
    return np.where(np.abs(q) <= 0.425, centre, np.where(q < 0.0, -tail, tail))


def _ratio(pieces: tuple[tuple[float, ...], tuple[float, ...]], x: F) -> F:
    return _horner(pieces[0], x) / _horner(pieces[1], x)


def _horner(coefficients: tuple[float, ...], x: F) -> F:
    total: Any = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total
