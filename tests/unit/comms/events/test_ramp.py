"""Ramps: what they make of a radio's numbers, and which they leave alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.air.parameters.bursts import Bursts
from swarmwire.comms.air.parameters.gives import Gives, RangeGiven
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.tuning import number_of
from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.ramp import Ramp
from swarmwire.comms.events.swarm import Swarm
from tests.support.comms.air.signal.radios import WIFI_B

RADIO = Radio(2.0, loss=0.1, bursts=Bursts(), gives=Gives(range=RangeGiven(0.01)))
SWARM = Swarm({"a": range(2)}, 2, np.array([7], np.uint64), np.zeros((2, 3)))


def under(*ramps: Ramp) -> Conditions:
    conditions = Conditions(2)
    for serial, ramp in enumerate(ramps):
        ramp.check_radio(RADIO)
        assert ramp.begin(serial, SWARM, conditions).all()
    return conditions


def numbers(conditions: Conditions, key: str, *at_s: float) -> list[float]:
    return [number_of(conditions.radio_at(RADIO, to_ns(one)), key) for one in at_s]


def ramp(what: str, to: float, at_s: float = 1.0, **keys: Any) -> Ramp:
    return Ramp(at_s=at_s, what=what, to=to, **keys)


def test_a_number_moves_evenly_and_stays_at_its_end():
    loss = numbers(under(ramp("radio.loss", 0.5, over_s=4.0)), "radio.loss", 1.0, 2.0, 3.0, 5.0, 9.0)
    assert loss == pytest.approx([0.1, 0.2, 0.3, 0.5, 0.5])
    assert loss[-1] == 0.5


def test_without_a_time_it_steps():
    assert numbers(under(ramp("radio.range_m", 1.5)), "radio.range_m", 1.0, 1.1) == [1.5, 1.5]


def test_whole_numbers_are_rounded_on_the_way():
    conditions = under(ramp("radio.queue_limit", 0.0, over_s=8.0))
    assert numbers(conditions, "radio.queue_limit", 1.0, 2.0, 2.1, 9.0) == [20, 18, 17, 0]
    assert isinstance(conditions.radio_at(RADIO, to_ns(2.1)).queue_limit, int)


def test_numbers_within_tables_move_and_nothing_else_does():
    conditions = under(ramp("radio.gives.range.noise_m", 0.5), ramp("radio.bursts.bad_s", 2.0))
    bursts, gives = Bursts(bad_s=2.0), Gives(range=RangeGiven(0.5))
    assert conditions.radio_at(RADIO, to_ns(1.0)) == replace(RADIO, bursts=bursts, gives=gives)


def test_a_ramp_sets_out_from_what_those_before_it_made_and_undone_leaves_that():
    first, second = ramp("radio.loss", 0.3), ramp("radio.loss", 0.9, at_s=2.0, over_s=2.0)
    conditions = under(first, second)
    assert numbers(conditions, "radio.loss", 2.0, 3.0, 4.0) == pytest.approx([0.3, 0.6, 0.9])
    second.end(1, conditions)
    assert numbers(conditions, "radio.loss", 4.0) == [0.3]
    first.end(0, conditions)
    assert conditions.radio_at(RADIO, to_ns(4.0)) is RADIO


def test_a_bit_rate_that_a_standard_has_may_be_stepped_to_but_not_ramped():
    ramp("radio.bit_rate_bps", 2_000_000).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^over_s: radio\..*: .*1000000, 2000000.*got 1500000 bit/s"):
        ramp("radio.bit_rate_bps", 2_000_000, over_s=1.0).check_radio(WIFI_B)
    with pytest.raises(BadInput, match=r"^to: radio\..*got 3000000 bit/s"):
        ramp("radio.bit_rate_bps", 3_000_000).check_radio(WIFI_B)
