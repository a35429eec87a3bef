"""Fates keep their numbers: tallies, records and frames hold them."""

from swarmwire.comms.fates import FATE_NAMES, Fate


def test_each_fate_has_its_number() -> None:
    assert FATE_NAMES == (
        "heard",
        "out_of_range",
        "blocked",
        "lost",
        "queue_full",
        "too_large",
        "in_flight",
        "sender_dead",
        "receiver_dead",
        "blackout",
        "partitioned",
        "too_weak",
        "collided",
        "burst",
        "channel_busy",
        "jammed",
    )
    assert [int(fate) for fate in Fate] == list(range(len(FATE_NAMES)))
