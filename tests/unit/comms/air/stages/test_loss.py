"""Fixed loss is a keyed Bernoulli trial for each packet and receiver."""

import numpy as np
import pytest
from scipy.stats import binomtest

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from tests.support.comms.air.runs import everybody, make_air, run, scattered

# Two-sided, for each of the losses below; the seed is fixed, so a pass stays a pass.
FALSE_ALARM_RATE = 1e-4


@pytest.mark.parametrize("loss", [0.05, 0.3, 0.9])
def test_share_heard_lies_in_the_exact_binomial_interval(loss: float):
    told = run(make_air(Radio(2.0, loss=loss), 20), scattered(20), everybody(20), 30, 2)
    heard, in_range = len(told.heard("receiver")), int(told.tally.in_range[0])
    assert in_range > 2000
    assert binomtest(heard, in_range, 1.0 - loss).pvalue > FALSE_ALARM_RATE


def test_both_directions_and_following_packets_are_lost_independently():
    """Of the pairs that both send, half x half lose both ways; likewise a packet and the next."""
    told = run(make_air(Radio(99.0, loss=0.5), 20), scattered(20), everybody(20), 10, 2)
    lost = np.zeros((20, 20, 10), bool)
    lost[told.finished("sender"), told.finished("receiver"), told.finished("sequence")] = (
        told.finished("fate") == Fate.LOST
    )
    pairs = np.triu_indices(20, 1)
    both_ways = (lost & lost.transpose(1, 0, 2))[pairs]
    both_times = (lost[..., 1:] & lost[..., :-1])[~np.eye(20, dtype=bool)][:, ::2]
    assert binomtest(int(both_ways.sum()), both_ways.size, 0.25).pvalue > FALSE_ALARM_RATE
    assert binomtest(int(both_times.sum()), both_times.size, 0.25).pvalue > FALSE_ALARM_RATE


def test_no_loss_loses_nothing_and_full_loss_everything():
    for loss, fate in ((0.0, "HEARD"), (1.0, "LOST")):
        assert run(make_air(Radio(99.0, loss=loss), 5), scattered(5), everybody(5), 3, 2).fates() == {fate: 60}


def test_another_seed_loses_other_packets():
    radio = Radio(99.0, loss=0.5, send_offset="tick")
    one, other = (run(make_air(radio, 8, [s]), scattered(8), everybody(8), 2, 1).finished("fate") for s in (1, 2))
    assert (one != other).any()
