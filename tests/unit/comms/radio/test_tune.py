"""A radio whose numbers change while it runs: what was decided stays, draws do not shift, memory is kept."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.radio.config.impairments import Bursts, Measures, RangeMeasure
from swarmwire.comms.radio.config.phy import Antenna, Antennas, RobotAntenna
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import check_number, number_of, numbers_of
from tests.support.comms.radio.bursts import BurstLinks
from tests.support.comms.radio.runs import RATE_HZ, Run, at, everybody, make_medium, packets, scattered

PAIR = at((0, 0), (1, 0))
LOSSY = Radio(2.0, loss=0.4, latency_s=0.01, jitter_s=0.02, measures=Measures(range=RangeMeasure(0.1)))


def tuned(radio: Radio, changes: dict[int, Radio], robots: int = 8, ticks: int = 20, seeds: range = range(1)) -> Run:
    """Everybody broadcasts in each tick; the radio is another one from some ticks on."""
    out, rows = Run(make_medium(radio, robots, seeds)), robots * len(seeds)
    pose = np.concatenate([scattered(robots)] * len(seeds))
    for tick in range(ticks + 1):
        at_ns = tick_start_ns(tick, RATE_HZ)
        out.news.append(out.medium.step(at_ns, pose, radio=changes.get(tick)))
        if tick < ticks:
            out.medium.send(at_ns, tick, everybody(rows)(tick))
    out.last = out.medium.end()
    return out


def links(told: Run, first_s: float, stop_s: float) -> list[tuple[int, ...]]:
    """Packets on air in a span in the first arena, with their receivers, fates and times."""
    columns = [told.finished(name) for name in ("sender", "receiver", "sequence", "fate", "final_at_ns")]
    on_air_s = told.finished("on_air_at_ns") / 1e9
    rows = np.stack(columns, axis=1)[(told.finished("arena") == 0) & (on_air_s >= first_s) & (on_air_s < stop_s)]
    return sorted(map(tuple, rows.tolist()))


def test_before_and_after_a_change_packets_fare_as_under_each_radio_alone():
    other = replace(LOSSY, loss=0.8, latency_s=0.03, range_m=1.2)
    changed, before, after = tuned(LOSSY, {10: other}), tuned(LOSSY, {}), tuned(other, {})
    assert links(changed, 0.0, 1.0) == links(before, 0.0, 1.0)
    assert links(changed, 1.0, 9.0) == links(after, 1.0, 9.0)
    assert links(before, 1.0, 9.0) != links(after, 1.0, 9.0)


def test_a_change_that_is_none_changes_nothing_even_of_bursts():
    bursts = replace(LOSSY, bursts=Bursts(0.5, 0.5))
    same = {tick: replace(bursts) for tick in range(1, 20)}
    assert links(tuned(bursts, same), 0.0, 9.0) == links(tuned(bursts, {}), 0.0, 9.0)


def test_slower_bursts_find_the_same_links_however_many_others_had_been_kept():
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


def test_a_link_stays_in_its_burst_when_the_loss_within_changes():
    """A burst of hours: the link that was bad under the one radio is bad under the next."""
    hours = Bursts(5000.0, 5000.0)
    changed = tuned(Radio(9.0, bursts=hours), {10: Radio(9.0, bursts=replace(hours, loss_bad=0.0, loss_good=1.0))})
    before, after = links(changed, 0.0, 1.0), links(changed, 1.0, 9.0)
    bad = {row[:2] for row in before if row[3]}
    assert bad
    assert {row[:2] for row in after if not row[3]} == bad


def test_what_was_handed_over_keeps_its_airtime_and_its_place_and_what_comes_has_the_new():
    """Ten bytes take 80 ms at first, 40 ms from 0.1 s on."""
    slow = Radio(2.0, bit_rate_bps=1000, send_offset="tick")
    medium = make_medium(slow, 2)
    told = Run(medium)
    for tick in range(6):
        fast = replace(slow, bit_rate_bps=2000) if tick == 1 else None
        told.news.append(medium.step(tick_start_ns(tick, RATE_HZ), PAIR, radio=fast))
        if tick < 2:
            medium.send(tick_start_ns(tick, RATE_HZ), tick, packets([0, 0, 0]))
    assert (told.on_air("on_air_at_ns") // 1_000_000).tolist() == [0, 80, 160, 240, 280, 320]


def test_the_radio_graph_is_that_of_the_new_radio_once_it_holds():
    medium = make_medium(Radio(2.0), 2)
    assert len(medium.step(0, PAIR).edges) == 1
    assert len(medium.step(10, PAIR, radio=Radio(0.5)).edges) == 0
    assert medium.radio == Radio(0.5)


@pytest.mark.parametrize("loss", [0.0, 1.0])
def test_a_loss_may_come_and_go(loss: float):
    told = tuned(replace(LOSSY, loss=loss), {10: replace(LOSSY, loss=1.0 - loss)})
    on_air_s = told.on_air("on_air_at_ns") / 1e9
    lost = told.on_air("fate") == 3
    assert (lost == ((on_air_s < 1.0) == (loss == 1.0))).all()


def test_the_numbers_of_a_radio_are_those_that_a_ramp_may_move():
    radio = Radio(range_m=2.0, loss=0.3, bursts=Bursts(good_s=1.0, bad_s=0.5), send_offset=0.02)
    numbers = numbers_of(radio)
    assert (numbers["range_m"], numbers["loss"], numbers["bursts.bad_s"]) == (2.0, 0.3, 0.5)
    assert "send_offset" not in numbers
    assert "bodies_block" not in numbers
    for key, value in numbers.items():
        check_number(radio, f"radio.{key}", value)
        assert number_of(radio, f"radio.{key}") == value


RADIO = Antenna(10.0, 2.0)


def test_robots_without_anything_of_their_own_have_the_radios():
    alike = Antennas.alike(2)
    assert alike.send_dbm(RADIO).tolist() == [12.0, 12.0]
    assert alike.receive_dbi(RADIO).tolist() == [2.0, 2.0]


def test_groups_have_their_own_power_or_gain_or_both():
    groups = [
        (1, RobotAntenna(power_dbm=0.0)),
        (2, RobotAntenna(gain_dbi=-1.0)),
        (1, None),
        (1, RobotAntenna(1.0, 1.0)),
    ]
    mixed = Antennas.of_groups(groups)
    assert mixed.send_dbm(RADIO).tolist() == [2.0, 9.0, 9.0, 12.0, 2.0]
    assert mixed.receive_dbi(RADIO).tolist() == [2.0, -1.0, -1.0, 2.0, 1.0]
