"""Whether losses come singly or in bursts is told by a runs test: fixed loss passes it, bursts do not.

Wald and Wolfowitz: given how many packets of a sequence are lost, the runs of equal fates are as many as in a random
order. Two-sided, at 1 in 10,000 for each sequence; keys are fixed.
"""

import numpy as np
import pytest
from scipy import stats

from swarmwire.comms.air.parameters.bursts import Bursts
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from tests.support.comms.air.runs import at, make_air, packets, run

FALSE_ALARM_RATE = 1e-4
SENDERS, TICKS = 12, 1500


def sequences(radio: Radio) -> np.ndarray:
    """Which packets of each sender are lost to one listener, (senders, packets), one each tick."""
    pose = at(*((0.01 * i, 0.5) for i in range(SENDERS)), (0.0, 0.0))
    sent = packets(range(SENDERS), SENDERS)
    told = run(make_air(radio, SENDERS + 1), pose, lambda _: sent, TICKS, 2)
    lost = np.zeros((SENDERS, TICKS), bool)
    lost[told.finished("sender"), told.finished("sequence")] = told.finished("fate") != Fate.HEARD
    return lost


def runs_p(lost: np.ndarray) -> float:
    """The p-value of one sequence."""
    n, a = len(lost), int(lost.sum())
    b = n - a
    runs = 1 + int(np.count_nonzero(lost[1:] != lost[:-1]))
    mean = 1.0 + 2.0 * a * b / n
    variance = (mean - 1.0) * (mean - 2.0) / (n - 1.0)
    return float(2.0 * stats.norm.sf(abs(runs - mean) / np.sqrt(variance)))


@pytest.mark.parametrize("loss", [0.1, 0.5])
def test_fixed_loss_passes_the_runs_test(loss: float):
    p = [runs_p(lost) for lost in sequences(Radio(9.0, send_offset="tick", loss=loss))]
    assert min(p) > FALSE_ALARM_RATE / SENDERS
    # And the p-values are uniform, so that the test is neither blind nor loud: Kolmogorov-Smirnov, 1 in 10,000.
    assert stats.kstest(p, "uniform").pvalue > FALSE_ALARM_RATE


@pytest.mark.parametrize("bursts", [Bursts(0.5, 2.0), Bursts(0.5, 2.0, 0.8, 0.05)])
def test_bursts_of_as_much_loss_fail_it_on_every_link(bursts: Bursts):
    lost = sequences(Radio(9.0, send_offset="tick", bursts=bursts))
    assert max(runs_p(link) for link in lost) < FALSE_ALARM_RATE
    assert lost.mean() == pytest.approx(bursts.loss, abs=0.05)
