"""A radio whose parameters change while it runs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.antennas import Antenna, Antennas, RobotAntenna
from swarmwire.comms.radio.config.impairments import Bursts, Measures, RangeMeasure
from swarmwire.comms.radio.config.phy import Fading, ReceiverNoise, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import check_number, number_of, numbers_of
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import SentPackets
from tests.support.comms.radio import (
    METHODS,
    RATE_HZ,
    SIZE_M,
    BurstLinks,
    Run,
    at,
    everybody,
    make_medium,
    packets,
    run,
    scattered,
    with_access,
)

PAIR = at((0, 0), (1, 0))
LOSSY = Radio(2.0, loss=0.4, latency_s=0.01, jitter_s=0.02, measures=Measures(range=RangeMeasure(0.1)))
RADIO = Antenna(10.0, 2.0)
Change = Callable[[Disruption], None]
FEW = scattered(8) * [20.0, 20.0, 1.0]
# Ten bytes and 17 of overhead take about 77 ms.
SLOW = {"bit_rate_bps": 2800, "queue_limit": 4}
PHY_PAIR = at((0, 0), (5, 0))


def ran(
    medium: RadioMedium,
    pose: FloatArray,
    sent: Callable[[int], SentPackets],
    changes: dict[int, Change],
    ticks: int = 16,
    radios: dict[int, Radio] | None = None,
) -> Run:
    """Changes are made before the tick that they are listed under."""
    held, now = Disruption.none(len(pose)), dict[int, Disruption]()
    for tick in sorted(changes):
        changes[tick](held)
        now[tick] = replace(held)
    return run(medium, pose, sent, ticks, now=now, radios=radios)


def tuned(radio: Radio, changes: dict[int, Radio], robots: int = 8) -> Run:
    """Everybody broadcasts in each tick; the radio is another one from some ticks on."""
    return run(make_medium(radio, robots), scattered(robots), everybody(robots), 20, radios=changes)


def links(result: Run, first_s: float = 0.0, stop_s: float = 9.0) -> list[tuple[float, ...]]:
    """Packets on air in a span, with their receivers, fates and times."""
    columns = [result.finished(name) for name in ("sender", "receiver", "sequence", "fate", "final_at_ns")]
    on_air_s = result.finished("on_air_at_ns") / 1e9
    rows = np.stack(columns, axis=1)[(on_air_s >= first_s) & (on_air_s < stop_s)]
    return sorted(map(tuple, rows.tolist()))


def test_tune_applies_to_packets_after_the_change_only():
    other = replace(LOSSY, loss=0.8, latency_s=0.03, range_m=1.2)
    changed, before, after = tuned(LOSSY, {10: other}), tuned(LOSSY, {}), tuned(other, {})
    assert links(changed, 0.0, 1.0) == links(before, 0.0, 1.0)
    assert links(changed, 1.0, 9.0) == links(after, 1.0, 9.0)
    assert links(before, 1.0, 9.0) != links(after, 1.0, 9.0)
    assert changed.edges.tolist() == after.edges.tolist() != before.edges.tolist()


def test_tune_to_equal_bursts_changes_nothing():
    bursts = replace(LOSSY, bursts=Bursts(0.5, 0.5))
    same = {tick: replace(bursts) for tick in range(1, 20)}
    assert links(tuned(bursts, same), 0.0, 9.0) == links(tuned(bursts, {}), 0.0, 9.0)


def test_tune_to_slower_bursts_is_independent_of_other_links():
    """Others fill the table, which then forgets what is long past for the fast bursts, though not for the slow ones."""
    robots, links_ = 100, 50
    sender, receiver = np.zeros(links_, np.int64), np.arange(1, links_ + 1)
    others = np.divmod(np.arange(robots, 41 * robots), robots)
    others = tuple(column[others[0] != others[1]] for column in others)

    def bad_at_last(crowded: bool) -> list[bool]:
        states = BurstLinks(Bursts(0.01, 0.01), np.array([7], np.uint64), robots)
        states.lost(sender, receiver, np.zeros(links_, np.int64), np.full(links_, 0))
        if crowded:
            for sequence in range(2):
                at_ns = np.full(len(others[0]), (5 + sequence) * 10**9)
                states.lost(*others, np.full(len(others[0]), sequence), at_ns)
        states.change(Bursts(1e6, 1e6), 8 * 10**9)
        return states.lost(sender, receiver, np.ones(links_, np.int64), np.full(links_, 9 * 10**9)).tolist()

    assert bad_at_last(crowded=True) == bad_at_last(crowded=False)


def test_tune_of_burst_loss_keeps_links_in_their_burst():
    """A burst of hours: the link that was bad under the one radio is bad under the next."""
    hours = Bursts(5000.0, 5000.0)
    changed = tuned(Radio(9.0, bursts=hours), {10: Radio(9.0, bursts=replace(hours, loss_bad=0.0, loss_good=1.0))})
    before, after = links(changed, 0.0, 1.0), links(changed, 1.0, 9.0)
    bad = {row[:2] for row in before if row[3]}
    assert bad
    assert {row[:2] for row in after if not row[3]} == bad


def test_tune_keeps_airtime_of_packets_handed_over_before():
    """Ten bytes take 80 ms at first, 40 ms from 0.1 s on."""
    slow = Radio(2.0, bit_rate_bps=1000, send_offset="tick")
    fast = {1: replace(slow, bit_rate_bps=2000)}
    result = run(make_medium(slow, 2), PAIR, lambda _: packets([0, 0, 0]), 2, 3, radios=fast)
    assert (result.on_air("on_air_at_ns") // 1_000_000).tolist() == [0, 80, 160, 240, 280, 320]


@pytest.mark.parametrize("loss", [0.0, 1.0])
def test_tune_of_loss_applies_from_its_tick_on(loss: float):
    """Also of a radio that has no such stage before or after."""
    result = tuned(replace(LOSSY, loss=loss), {10: replace(LOSSY, loss=1.0 - loss)})
    on_air_s = result.on_air("on_air_at_ns") / 1e9
    lost = result.on_air("fate") == 3
    assert (lost == ((on_air_s < 1.0) == (loss == 1.0))).all()


def test_tunable_numbers_are_those_of_a_ramp():
    radio = Radio(range_m=2.0, loss=0.3, bursts=Bursts(good_s=1.0, bad_s=0.5), send_offset=0.02)
    numbers = numbers_of(radio)
    assert (numbers["range_m"], numbers["loss"], numbers["bursts.bad_s"]) == (2.0, 0.3, 0.5)
    assert "send_offset" not in numbers
    assert "bodies_block" not in numbers
    for key, value in numbers.items():
        check_number(radio, f"radio.{key}", value)
        assert number_of(radio, f"radio.{key}") == value


def test_antennas_of_groups_have_their_own_power_or_gain_or_the_radios():
    alike = Antennas.alike(2)
    assert (alike.send_dbm(RADIO).tolist(), alike.receive_dbi(RADIO).tolist()) == ([12.0, 12.0], [2.0, 2.0])
    own = RobotAntenna(power_dbm=0.0), RobotAntenna(gain_dbi=-1.0), RobotAntenna(1.0, 1.0)
    mixed = Antennas.of_groups([(1, own[0]), (2, own[1]), (1, None), (1, own[2])])
    assert mixed.send_dbm(RADIO).tolist() == [2.0, 9.0, 9.0, 12.0, 2.0]
    assert mixed.receive_dbi(RADIO).tolist() == [2.0, -1.0, -1.0, 2.0, 1.0]


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


def everything(method: str) -> Radio:
    return replace(with_access(method), send_offset="uniform", shadowing=Shadowing(), fading=Fading(), loss=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_tune_to_equal_parameters_changes_nothing(method: str):
    radio = everything(method)

    def ended(sent: Callable[[int], SentPackets], changes: dict[int, Change], radios: dict[int, Radio]):
        return links(ran(make_medium(radio, 8), FEW, sent, changes, radios=radios))

    def pausing(tick: int) -> SentPackets:
        return SentPackets.none() if tick in (2, 3, 4) else everybody(8)(0)

    same = {tick: replace(radio) for tick in range(1, 16)}
    assert ended(everybody(8), {}, same) == ended(everybody(8), {}, {})
    assert ended(pausing, {3: gained(1.0), 4: gained(0.0)}, {}) == ended(pausing, {}, {})


@pytest.mark.parametrize("method", ["none", "aloha"])
def test_tune_of_a_phy_applies_to_packets_after_the_change_only(method: str):
    radio = everything(method)
    other = replace(radio, antenna=Antenna(-25.0), noise=ReceiverNoise(5e6, 3.0), loss=0.3)
    changed = ran(make_medium(radio, 8), FEW, everybody(8), {}, radios={8: other})
    assert links(changed, 0.0, 0.79) == links(ran(make_medium(radio, 8), FEW, everybody(8), {}), 0.0, 0.79)
    alone = ran(make_medium(other, 8), FEW, everybody(8), {})
    assert links(changed, 0.85, 9.0) == links(alone, 0.85, 9.0)
    np.testing.assert_array_equal(changed.edges, alone.edges)


@pytest.mark.parametrize(("at_tick", "received"), [(1, 0), (7, 1)])
def test_tune_of_noise_applies_within_a_frame(at_tick: int, received: int):
    """It takes 0.5 s, and the noise rises beyond hope when a tenth, or nine tenths, of it is over."""
    slow = replace(with_access("aloha"), bit_rate_bps=900, max_payload_bytes=60)
    noisy, pose = replace(slow, noise=ReceiverNoise(5e6, 30.0)), at((0, 0), (50, 0))
    result = run(make_medium(slow, 2), pose, lambda _: packets([0], size=40), 1, 15, radios={at_tick: noisy})
    assert result.fates().get("RECEIVED", 0) == received


def test_gain_of_sender_equals_power_and_of_receiver_an_antenna():
    radio = replace(with_access("aloha"), send_offset="uniform")
    pose = at((0, 0), (95, 0), (0, 99), (-105, 0))
    weaker = ran(make_medium(replace(radio, antenna=Antenna(power_dbm=-3.0)), 4), pose, everybody(4), {})
    assert links(ran(make_medium(radio, 4), pose, everybody(4), {0: gained(send_db=-3.0)})) == links(weaker)
    assert links(ran(make_medium(radio, 4), pose, everybody(4), {0: gained(receive_db=-3.0)})) == links(weaker)
    assert links(weaker) != links(ran(make_medium(radio, 4), pose, everybody(4), {}))


def test_gain_of_a_deaf_antenna_still_sends_but_has_no_edge():
    deaf = gained(receive_db=np.array([-60.0, 0.0]))
    for changes, receivers, edges in (({0: deaf}, {1}, []), ({0: deaf, 3: gained()}, {0, 1}, [[0, 1]])):
        medium = make_medium(with_access("none"), 2)
        result = ran(medium, at((0, 0), (50, 0)), lambda _: packets([0, 1]), changes, 6)
        assert set(result.received("receiver").tolist()) == receivers
        assert result.edges.tolist() == edges


def test_gain_can_exceed_the_former_range():
    far = at((0, 0), (900, 0))
    assert ran(make_medium(with_access("none"), 2), far, lambda _: packets([0]), {}, 4).fates() == {"OUT_OF_RANGE": 4}
    result = ran(make_medium(with_access("none"), 2), far, lambda _: packets([0]), {0: gained(send_db=40.0)}, 4)
    assert result.fates()["RECEIVED"] >= 3


def test_antenna_power_of_a_group_decides_reception():
    """The strong are received by the weak, who are not received by them."""
    radio, pose = with_access("none"), at((0, 0), (200, 0))
    antennas = Antennas.of_groups([(1, RobotAntenna(power_dbm=20.0)), (1, None)])
    keys = np.array([derive_key(1, "air")], np.uint64)
    medium = RadioMedium(replace(ChannelContext.open_space(radio, keys, 2, SIZE_M), antennas=antennas), RATE_HZ)
    result = ran(medium, pose, lambda _: packets([0, 1]), {}, 5)
    assert set(result.received("receiver").tolist()) == {1}


def on_air_ticks(result: Run) -> list[int]:
    return (result.on_air("on_air_at_ns") // 10**8).tolist()


@pytest.mark.parametrize("method", ["none", "aloha", "csma-802154"])
def test_backlog_of_all_waits_for_the_radio_up_to_the_limit(method: str):
    """Off from 0.2 to 0.8 s: four of six wait, and go out one after the other, before that of 0.8 s."""
    radio = replace(with_access(method), **SLOW)

    def sent(tick: int) -> SentPackets:
        return packets([0] * (tick < 9))

    result = ran(make_medium(radio, 2), PHY_PAIR, sent, {2: switched(ALL, 0), 8: switched(ALL)})
    assert result.fates() == {"RECEIVED": 7, "QUEUE_FULL": 2}
    assert result.received("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    assert min(on_air_ticks(result)[2:]) == 8
    dropped = ran(make_medium(radio, 2), PHY_PAIR, sent, {2: switched(DROP, 0), 8: switched(DROP)})
    assert dropped.fates() == {"RECEIVED": 3, "BLACKOUT": 6}


@pytest.mark.parametrize("method", METHODS)
def test_backlog_of_newest_replaces_the_waiting_packet(method: str):
    medium, changes = make_medium(with_access(method), 2), {2: switched(NEWEST, 0), 8: switched(NEWEST)}
    result = ran(medium, PHY_PAIR, lambda tick: packets([0] * (tick < 8)), changes)
    assert result.fates() == {"RECEIVED": 3, "BLACKOUT": 5}
    assert result.received("sequence").tolist() == [0, 1, 7]


@pytest.mark.parametrize("method", METHODS)
def test_backlog_of_addressed_packets_is_received_once(method: str):
    for changes, fates in (
        ({1: switched(ALL, 0), 6: switched(ALL)}, {"RECEIVED": 8}),
        ({1: switched(ALL, 0), 4: switched(NEWEST, 0), 6: switched(DROP)}, {"RECEIVED": 3, "BLACKOUT": 5}),
    ):
        medium = make_medium(with_access(method), 2)
        assert ran(medium, PHY_PAIR, lambda tick: packets([0] * 2 * (tick < 4), 1), changes).fates() == fates


def test_partition_one_way_removes_the_edge():
    def apart(held: Disruption) -> None:
        held.one_way = np.array([[1, 2]])

    forth, back = (
        ran(make_medium(with_access("aloha"), 2), PHY_PAIR, lambda _, sender=sender: packets([sender]), {0: apart}, 4)
        for sender in (0, 1)
    )
    assert forth.fates() == {"PARTITIONED": 4}
    assert not len(forth.edges)
    assert back.fates()["RECEIVED"] >= 3
