"""How well a share is known that was counted: an interval for the probability of single yes-or-no trials."""

from statistics import NormalDist

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray


def binomial_interval(
    successes: IntArray | FloatArray, trials: IntArray | FloatArray, confidence: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Wilson's score interval of a probability, lower and upper ends (k,); NaN where there was no trial.

    With p = successes / trials = s / n: (p + z^2 / 2n ± z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n). Trials are
    taken to be independent. It stays within 0 and 1, also for shares of 0 and 1.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927) 209-212.
    """
    z2 = NormalDist().inv_cdf(0.5 + 0.5 * confidence) ** 2
    n = np.where(np.asarray(trials) > 0, trials, np.nan).astype(np.float64)
    share = np.asarray(successes) / n
    half = np.sqrt(z2 * (share * (1.0 - share) / n + z2 / (4.0 * n * n)))
    middle = share + z2 / (2.0 * n)
    # Rounding would leave an end of a share of 0 or 1 just beside it.
    low = np.where(share == 0.0, 0.0, (middle - half) / (1.0 + z2 / n))
    high = np.where(share == 1.0, 1.0, (middle + half) / (1.0 + z2 / n))
    return low, high
