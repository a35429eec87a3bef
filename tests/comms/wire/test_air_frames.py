"""What the world's air tells a robot nearby is of times that a run can have."""

import numpy as np
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import NO_OUTCOMES
from swarmwire.comms.packets import Heard
from swarmwire.comms.wire.air_frames import decode_air, encode_air
from swarmwire.comms.wire.air_terms import AirTerms

TERMS = AirTerms(1, ("a", "b"), 10, 100, (), ())


def test_a_tick_that_a_run_can_have_is_taken() -> None:
    assert decode_air(encode_air(7, 1, Heard.none(), NO_OUTCOMES), TERMS)[0] == 7


@pytest.mark.parametrize("tick", [-1, 2**62 // 10**8, 2**63, 2**64 - 2])
def test_a_tick_that_no_run_has_is_refused(tick: int) -> None:
    with pytest.raises(BadFrame):
        decode_air(encode_air(tick, 1, Heard.none(), NO_OUTCOMES), TERMS)
    assert np.int64(2**62 - 1) + 2**62 > 0, "what is added to such a time fits"
