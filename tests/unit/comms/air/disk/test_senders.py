"""How long a packet keeps its sender's radio, and that one that is refused keeps it for no time."""

import numpy as np

from swarmwire.comms.air.intake import Intake
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import NOWHERE
from tests.support.comms.air.runs import at, make_air, packets, run

PAIR = at((0, 0), (1, 0))


def test_a_packet_is_on_air_for_its_bytes_and_those_of_its_frame():
    radio = Radio(2.0, bit_rate_bps=1000, overhead_bytes=6, max_payload_bytes=10, send_offset="tick")
    told = run(make_air(radio, 2), PAIR, lambda _: packets([0, 0, 0], size=[10, 11, 10]), 1, 4)
    assert (told.heard("heard_at_ns") // 10**6).tolist() == [128, 256]
    departed = [one.departed for one in told.news]
    lasts_ns = np.concatenate([of.off_air_at_ns - of.on_air_at_ns for of in departed])
    fate = np.concatenate([of.fate for of in departed])
    assert sorted(zip(fate.tolist(), (lasts_ns // 1000).tolist(), strict=True)) == [
        (Fate.HEARD, 128_000),
        (Fate.HEARD, 128_000),
        (Fate.TOO_LARGE, 0),
    ]
    assert lasts_ns[fate == Fate.TOO_LARGE].tolist() == [0]


def test_packets_are_taken_in_by_sender_in_whatever_order_the_crew_tells_them():
    intake = Intake(4)
    for before in (0, 2):
        taken = intake.take(np.zeros(4, np.int64), packets([3, 1, 3, 1], to=[0, 1, 2, 3]), np.full(4, 3), 7)
        assert taken.sender.tolist() == [1, 1, 3, 3]
        assert taken.to.tolist() == [1, 3, 0, 2]
        assert (taken.sequence - before).tolist() == [0, 1, 0, 1]
        assert [taken.payloads.row(k)[0] for k in range(4)] == [1, 3, 0, 2]
        assert (taken.intended.tolist(), taken.epoch.tolist()) == ([1] * 4, [7] * 4)


def test_packets_to_nobody_take_a_number_and_go_nowhere():
    taken = Intake(2).take(np.zeros(2, np.int64), packets([0, 0, 1], to=[NOWHERE, 1, NOWHERE]), np.ones(2, np.int64), 0)
    assert (taken.sender.tolist(), taken.sequence.tolist()) == ([0], [1])
