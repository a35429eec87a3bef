"""Over signals, too, results do not depend on how time, world or crew are divided."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.air.parameters.bursts import Bursts
from swarmwire.comms.air.parameters.propagation import Fading, Shadowing
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.packets import BROADCAST, Sent
from tests.support.comms.air.runs import Run, make_air, packets, run, scattered
from tests.support.comms.air.signal.radios import ALL_GIVEN, METHODS, with_access

ROBOTS = 8


def everything(method: str) -> Radio:
    """All that draws."""
    return replace(
        with_access(method),
        send_offset="uniform",
        loss=0.1,
        jitter_s=0.05,
        shadowing=Shadowing(),
        fading=Fading(),
        bursts=Bursts(0.2, 0.4),
        gives=ALL_GIVEN,
    )


def story(told: Run, arena: int = 0) -> list[tuple[object, ...]]:
    """Everything heard and every other fate in one arena."""
    rows: list[tuple[object, ...]] = []
    for one in told.news:
        h, f = one.heard, one.finished
        for i in np.flatnonzero(h.receiver // ROBOTS == arena):
            given = tuple(column[i] for column in h.given.values())
            rows.append((h.receiver[i] % ROBOTS, h.sender[i], h.sequence[i], h.heard_at_ns[i], *given))
        columns = f.receiver, f.sender, f.sequence, f.fate, f.on_air_at_ns, f.final_at_ns
        rows += [tuple(column[i] for column in columns) for i in np.flatnonzero(f.arena == arena)]
    return sorted(rows)


def traffic(arenas: int) -> Sent:
    """Each robot sends two broadcasts and one packet to its neighbour."""
    sender = np.repeat(np.arange(arenas * ROBOTS), 3)
    to = np.where(np.arange(len(sender)) % 3 == 2, (sender + 1) % ROBOTS, BROADCAST)
    return packets(sender, to)


@pytest.mark.parametrize("method", METHODS)
def test_time_may_pass_in_any_pieces(method: str):
    pose = scattered(ROBOTS) * [10.0, 10.0, 1.0]
    stories = []
    for pieces in (1, 2, 97):
        air = make_air(everything(method), ROBOTS)
        told = Run(air)
        for tick in range(4):
            air.hold(pose + 0.01 * tick, np.ones(ROBOTS, bool))
            air.send(tick * 10**8, tick, traffic(1))
            for piece in range(1, pieces + 1):
                told.news.append(air.advance(tick * 10**8 + 10**8 * piece // pieces))
        stories.append(story(told))
    assert len(stories[0]) > 200
    assert stories[0] == stories[1] == stories[2]


@pytest.mark.parametrize("method", METHODS)
def test_an_arena_alone_gives_the_same_as_beside_others(method: str):
    seeds = (11, 12, 13)
    pose = scattered(3 * ROBOTS) * [20.0, 20.0, 1.0]
    beside = run(make_air(everything(method), ROBOTS, seeds), pose, lambda _: traffic(3), 4, 2)
    for arena, seed in enumerate(seeds):
        own = pose[arena * ROBOTS : (arena + 1) * ROBOTS]
        alone = run(make_air(everything(method), ROBOTS, [seed]), own, lambda _: traffic(1), 4, 2)
        assert story(alone) == story(beside, arena)


def test_the_order_among_senders_is_indifferent():
    pose, sent = scattered(ROBOTS) * [20.0, 20.0, 1.0], traffic(1)
    index = np.arange(len(sent)).reshape(ROBOTS, 3)[::-1].ravel()
    mixed = Sent(sent.sender[index], sent.to[index], sent.payloads.rows(index))
    radio = everything("csma-802154")
    runs = [run(make_air(radio, ROBOTS), pose, lambda _, of=of: of, 3, 2) for of in (sent, mixed)]
    assert story(runs[0]) == story(runs[1])


@pytest.mark.parametrize("method", METHODS)
def test_a_robot_beyond_the_cut_off_changes_nothing(method: str):
    """It stands far away and sends all the time."""
    radio = replace(everything(method), range_m=40.0)
    pose = scattered(ROBOTS)
    pose[-1, :2] = 60.0, 60.0
    with_it, without = (
        run(make_air(radio, ROBOTS), pose, lambda _, k=k: packets([*range(ROBOTS - 1)] + [ROBOTS - 1] * k), 4, 2)
        for k in (5, 0)
    )
    assert story(without)
    assert [row for row in story(with_it) if row[1] != ROBOTS - 1 and row[0] != ROBOTS - 1] == story(without)


def test_the_cut_off_decides_from_where_on_a_robot_disturbs():
    """A link at 1 dB over noise, and 20 robots that send at the same time, each at the receiver's noise less 9 dB."""
    radio = with_access("aloha")
    near_m, far_m = (10.0 ** ((-radio.noise_or_default.power_dbm - 46.6777 - db) / 30.0) for db in (1.0, -9.0))
    pose = np.zeros((22, 3))
    pose[1:, 0] = -far_m
    pose[1, 0] = near_m
    heard = {
        (senders, cut_off_db): heard_from_1_at_0(
            run(
                make_air(replace(radio, cut_off_db=cut_off_db), 22),
                pose,
                lambda _, n=senders: packets([*range(1, n)]),
                30,
            )
        )
        for senders, cut_off_db in ((2, 10.0), (22, 8.0), (22, 10.0))
    }
    assert heard[2, 10.0] == heard[22, 8.0] > 20
    assert heard[22, 10.0] < 10


def heard_from_1_at_0(told: Run) -> int:
    """How many packets robot 0 heard from robot 1."""
    return sum(int(np.sum((one.heard.receiver == 0) & (one.heard.sender == 1))) for one in told.news)
