"""A scenario's choice of a receiver is the receiver that it names, or refused."""

import pytest

from swarmwire.comms.air.parameters.reception import Reception, SuccessTable, refuse_unfit
from swarmwire.comms.air.reception import dsss, ofdm
from swarmwire.comms.air.reception.receiver import (
    by_table,
    by_threshold,
    chunk_success,
    ieee80211ag,
    ieee80211b,
    ieee802154,
    receiver_of,
)
from swarmwire.comms.errors import BadInput

TABLE = SuccessTable((0.0, 6.0), (0.0, 1.0), 800)


@pytest.mark.parametrize(
    ("reception", "bit_rate_bps", "expected"),
    [
        (Reception(), 250_000, ieee802154()),
        (Reception("threshold", least_sinr_db=3.0), 1, by_threshold(3.0)),
        (Reception("table", table=TABLE), 1, by_table(TABLE)),
        *((Reception("802.11b"), rate_bps, ieee80211b(rate_bps)) for rate_bps in dsss.RATES_BPS),
        *((Reception("802.11ag"), rate_bps, ieee80211ag(rate_bps)) for rate_bps in ofdm.RATES_BPS),
    ],
)
def test_the_receiver_is_the_one_that_is_named(reception: Reception, bit_rate_bps: int, expected):
    refuse_unfit(reception, bit_rate_bps, "a.toml", "radio.reception")
    receiver = receiver_of(reception, bit_rate_bps)
    assert receiver[:4] == expected[:4]
    for sinr in (0.1, 1.0, 1.99, 2.0, 3.0, 10.0, 100.0):
        assert chunk_success(receiver, sinr, 400) == chunk_success(expected, sinr, 400)


@pytest.mark.parametrize(
    ("reception", "key"),
    [
        (Reception("table"), "radio.reception.table"),
        (Reception("table", table=SuccessTable((1.0, 0.0), (0.0, 1.0), 8)), "radio.reception.table.sinr_db"),
        (Reception("802.11b"), "radio.reception.model"),
        (Reception("802.11ag"), "radio.reception.model"),
    ],
)
def test_what_does_not_go_together_is_refused(reception: Reception, key: str):
    with pytest.raises(BadInput) as refused:
        refuse_unfit(reception, 250_000, "a.toml", "radio.reception")
    assert refused.value.key == key
