"""A radio with a PHY whose numbers, antennas or switches change while it runs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import SentPackets
from swarmwire.comms.radio.config.phy import Antenna, Antennas, Fading, Noise, RobotAntenna, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.radio.phy.radios import METHODS, with_access
from tests.support.comms.radio.runs import RATE_HZ, SIZE_M, Run, at, everybody, make_medium, packets, scattered

Change = Callable[[Disruption], Radio | None]
FEW = scattered(8) * [20.0, 20.0, 1.0]


def ran(
    medium: RadioMedium,
    pose: FloatArray,
    sent: Callable[[int], SentPackets],
    changes: dict[int, Change],
    ticks: int = 16,
) -> Run:
    """Changes are made before the tick that they are listed under."""
    told, held = Run(medium), Disruption.none(len(pose))
    for tick in range(ticks + 1):
        radio = changes.get(tick, lambda _: None)(held)
        coming = Disruption.none(len(pose))
        coming.become(held)
        told.news.append(medium.step(tick_start_ns(tick, RATE_HZ), pose, coming, radio))
        if tick < ticks:
            medium.send(tick_start_ns(tick, RATE_HZ), tick, sent(tick))
    told.last = medium.end()
    return told


def tuned(radio: Radio) -> Change:
    return lambda _: radio


def gained(send_db: FloatArray | float = 0.0, receive_db: FloatArray | float = 0.0) -> Change:
    def change(held: Disruption) -> None:
        held.send_gain_db = np.zeros(len(held.alive)) + send_db
        held.receive_gain_db = np.zeros(len(held.alive)) + receive_db

    return change


def switched(backlog: int, *off: int) -> Change:
    def change(held: Disruption) -> None:
        held.radio_on = np.ones(len(held.alive), np.bool_)
        held.radio_on[list(off)] = False
        held.backlog = np.full(len(held.alive), backlog)

    return change


def links(told: Run, first_s: float = 0.0, stop_s: float = 9.0) -> list[tuple[float, ...]]:
    columns = [told.finished(name) for name in ("sender", "receiver", "sequence", "fate", "final_at_ns")]
    on_air_s = told.finished("on_air_at_ns") / 1e9
    rows = np.stack(columns, axis=1)[(on_air_s >= first_s) & (on_air_s < stop_s)]
    return sorted(map(tuple, rows.tolist()))


def everything(method: str) -> Radio:
    return replace(with_access(method), send_offset="uniform", shadowing=Shadowing(), fading=Fading(), loss=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_a_change_that_is_none_changes_nothing(method: str):
    radio = everything(method)
    same: dict[int, Change] = {tick: tuned(replace(radio)) for tick in range(1, 16)}
    plain = ran(make_medium(radio, 8), FEW, everybody(8), {})
    assert links(ran(make_medium(radio, 8), FEW, everybody(8), same)) == links(plain)
    gains: dict[int, Change] = {3: gained(1.0), 4: gained(0.0)}
    apart = ran(
        make_medium(radio, 8), FEW, lambda tick: everybody(8)(0) if tick not in (2, 3, 4) else SentPackets.none(), gains
    )
    silent = ran(
        make_medium(radio, 8), FEW, lambda tick: everybody(8)(0) if tick not in (2, 3, 4) else SentPackets.none(), {}
    )
    assert links(apart) == links(silent)


@pytest.mark.parametrize("method", ["none", "aloha"])
def test_before_and_after_a_change_packets_fare_as_under_each_radio_alone(method: str):
    radio = everything(method)
    other = replace(radio, antenna=Antenna(-25.0), noise=Noise(5e6, 3.0), loss=0.3)
    changed = ran(make_medium(radio, 8), FEW, everybody(8), {8: tuned(other)})
    assert links(changed, 0.0, 0.79) == links(ran(make_medium(radio, 8), FEW, everybody(8), {}), 0.0, 0.79)
    alone = ran(make_medium(other, 8), FEW, everybody(8), {})
    assert links(changed, 0.85, 9.0) == links(alone, 0.85, 9.0)
    np.testing.assert_array_equal(changed.edges, alone.edges)


def test_a_frame_on_air_meets_both_noises():
    """It takes 0.5 s, and the noise rises beyond hope when a tenth, or nine tenths, of it is over."""
    slow = replace(with_access("aloha"), bit_rate_bps=900, max_payload_bytes=60)
    loud = replace(slow, noise=Noise(5e6, 30.0))

    def received(at_tick: int) -> int:
        told = ran(
            make_medium(slow, 2),
            at((0, 0), (50, 0)),
            lambda tick: packets([0] * (tick == 0), size=40),
            {at_tick: tuned(loud)},
        )
        return told.fates().get("RECEIVED", 0)

    assert received(1) == 0
    assert received(7) == 1


def test_a_gain_of_the_sender_is_worth_as_much_as_power_and_one_of_the_receiver_as_an_antenna():
    radio = replace(with_access("aloha"), send_offset="uniform")
    pose = at((0, 0), (95, 0), (0, 99), (-105, 0))
    weaker = ran(make_medium(replace(radio, antenna=Antenna(power_dbm=-3.0)), 4), pose, everybody(4), {})
    assert links(ran(make_medium(radio, 4), pose, everybody(4), {0: gained(send_db=-3.0)})) == links(weaker)
    assert links(ran(make_medium(radio, 4), pose, everybody(4), {0: gained(receive_db=-3.0)})) == links(weaker)
    assert links(weaker) != links(ran(make_medium(radio, 4), pose, everybody(4), {}))


def test_an_antenna_that_hears_badly_still_sends_well_and_no_edge_leads_to_it():
    deaf = gained(receive_db=np.array([-60.0, 0.0]))
    told = ran(make_medium(with_access("none"), 2), at((0, 0), (50, 0)), lambda _: packets([0, 1]), {0: deaf}, 6)
    assert set(told.received("receiver").tolist()) == {1}
    assert not len(told.edges)
    back = ran(
        make_medium(with_access("none"), 2), at((0, 0), (50, 0)), lambda _: packets([0, 1]), {0: deaf, 3: gained()}, 6
    )
    assert set(back.received("receiver").tolist()) == {0, 1}
    assert back.edges.tolist() == [[0, 1]]


def test_a_gain_may_reach_farther_than_any_radio_did_before():
    far = at((0, 0), (900, 0))
    assert ran(make_medium(with_access("none"), 2), far, lambda _: packets([0]), {}, 4).fates() == {"OUT_OF_RANGE": 4}
    told = ran(make_medium(with_access("none"), 2), far, lambda _: packets([0]), {0: gained(send_db=40.0)}, 4)
    assert told.fates()["RECEIVED"] >= 3


def test_groups_have_their_own_power():
    """The strong are received by the weak, who are not received by them."""
    radio, pose = with_access("none"), at((0, 0), (200, 0))
    antennas = Antennas.of_groups([(1, RobotAntenna(power_dbm=20.0)), (1, None)])
    keys = np.array([derive_key(1, "air")], np.uint64)
    medium = RadioMedium(radio, keys, 2, SIZE_M, obstacle_arrays(((),)), RATE_HZ, antennas=antennas)
    told = ran(medium, pose, lambda _: packets([0, 1]), {}, 5)
    assert set(told.received("receiver").tolist()) == {1}


@pytest.mark.parametrize("method", ["none", "aloha", "csma-802154", "dcf"])
def test_gains_elsewhere_do_not_reach_into_an_arena(method: str):
    """Other arenas' antennas reach so far that all would be near: their own pairs stay what they were."""
    radio = replace(everything(method), shadowing=Shadowing(10.0, 2.0))
    far = 2.0 if method == "dcf" else 6.0
    pose = FEW * [far, far, 1.0]
    alone = ran(make_medium(radio, 8, [5]), pose, everybody(8), {})
    elsewhere = np.repeat([30.0, 0.0], 8)
    three = ran(make_medium(radio, 8, [1, 5]), np.tile(pose, (2, 1)), everybody(16), {0: gained(elsewhere)})
    own = three.finished("arena") == 1
    assert len(links(alone)) > 50
    columns = ("sender", "receiver", "sequence", "fate", "final_at_ns")
    assert sorted(zip(*(three.finished(name)[own].tolist() for name in columns), strict=True)) == links(alone)


# Ten bytes and 17 of overhead take about 77 ms.
SLOW = {"bit_rate_bps": 2800, "queue_limit": 4}
PAIR = at((0, 0), (5, 0))


def on_air_ticks(told: Run) -> list[int]:
    return (told.on_air("on_air_at_ns") // 10**8).tolist()


@pytest.mark.parametrize("method", ["none", "aloha", "csma-802154"])
def test_all_wait_for_their_radio_up_to_the_limit(method: str):
    """Off from 0.2 to 0.8 s: four of six wait, and go out one after the other, before that of 0.8 s."""
    radio = replace(with_access(method), **SLOW)

    def sent(tick: int) -> SentPackets:
        return packets([0] * (tick < 9))

    told = ran(make_medium(radio, 2), PAIR, sent, {2: switched(ALL, 0), 8: switched(ALL)})
    assert told.fates() == {"RECEIVED": 7, "QUEUE_FULL": 2}
    assert told.received("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    assert min(on_air_ticks(told)[2:]) == 8
    dropped = ran(make_medium(radio, 2), PAIR, sent, {2: switched(DROP, 0), 8: switched(DROP)})
    assert dropped.fates() == {"RECEIVED": 3, "BLACKOUT": 6}


@pytest.mark.parametrize("method", METHODS)
def test_the_newest_waits_and_what_it_replaces_ends_with_the_blackout(method: str):
    told = ran(
        make_medium(with_access(method), 2),
        PAIR,
        lambda tick: packets([0] * (tick < 8)),
        {2: switched(NEWEST, 0), 8: switched(NEWEST)},
    )
    assert told.fates() == {"RECEIVED": 3, "BLACKOUT": 5}
    assert told.received("sequence").tolist() == [0, 1, 7]


@pytest.mark.parametrize("method", METHODS)
def test_addressed_packets_wait_too_and_are_received_once(method: str):
    def sent(tick: int) -> SentPackets:
        return packets([0] * 2 * (tick < 4), 1)

    told = ran(make_medium(with_access(method), 2), PAIR, sent, {1: switched(ALL, 0), 6: switched(ALL)})
    assert told.fates() == {"RECEIVED": 8}
    stricter = ran(
        make_medium(with_access(method), 2),
        PAIR,
        sent,
        {1: switched(ALL, 0), 4: switched(NEWEST, 0), 6: switched(DROP)},
    )
    assert stricter.fates() == {"RECEIVED": 3, "BLACKOUT": 5}


def test_one_way_the_radio_graph_of_signals_has_no_edge():
    def apart(held: Disruption) -> None:
        held.one_way = np.array([[1, 2]])

    told = ran(make_medium(with_access("aloha"), 2), PAIR, lambda _: packets([0]), {0: apart}, 4)
    assert told.fates() == {"PARTITIONED": 4}
    assert not len(told.edges)
    assert (
        ran(make_medium(with_access("aloha"), 2), PAIR, lambda _: packets([1]), {0: apart}, 4).fates()["RECEIVED"] >= 3
    )
