"""Jammers, and retries of the MAC."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.phy import ReceiverNoise, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import NEWEST, Disruption, Jammers
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Fate, SentPackets, TxResult
from tests.support.comms.radio import (
    TICK_NS,
    Run,
    at,
    everybody,
    jammed_by,
    jammers,
    make_medium,
    packets,
    run,
    scattered,
    with_access,
)

NOISE_DBM, NEAR_LOSS_DB = -106.987, 46.6777  # of the radio; nearer than 1 m the path loss is constant
# Senders that collide now and then, around a receiver that hears some of them barely.
CROWD = at((0, 0), (70, 0), (0, -75), (-60, 60), (40, 0), (0, 30))
TO_FIRST = packets([1, 2, 3, 4, 5] * 3, 0, size=40)
# A frame of 117 bytes lasts 78 ms: attempts and ticks overlap.
SLOW = replace(with_access("csma-802154"), bit_rate_bps=12_000, send_offset="tick")
Plan = Callable[[int], dict[str, list[float]]]


def ran(
    medium: RadioMedium, pose: FloatArray, sent: SentPackets, held: Jammers, ticks: int = 20, quiet_ticks: int = 3
) -> Run:
    """The same is sent in each tick, while these jammers stand."""
    return run(medium, pose, lambda _: sent, ticks, quiet_ticks - 1, {0: jammed_by(held, len(pose))})


def received(result: Run) -> list[tuple[int, ...]]:
    return result.rows("received", "receiver", "sender_index", "sequence")


@pytest.mark.parametrize("rise_db", [0.5, 1.5, 3.0, 10.0])
def test_jammer_equals_noise_of_the_same_power(rise_db: float):
    """To the last packet: the draws are the same."""
    radio = replace(with_access("aloha"), send_offset="uniform")
    rise = 10 ** (rise_db / 10)
    power_dbm = NOISE_DBM + NEAR_LOSS_DB + 10 * np.log10(rise - 1)
    jammed = ran(make_medium(radio, 6), CROWD, TO_FIRST, jammers({"power_dbm": power_dbm}))
    noisy = ran(make_medium(replace(radio, noise=ReceiverNoise(5e6, rise_db)), 6), CROWD, TO_FIRST, Jammers.none())
    assert received(jammed) == received(noisy)
    clear = ran(make_medium(radio, 6), CROWD, TO_FIRST, Jammers.none()).fates()
    assert jammed.fates()["JAMMED"] > 0
    assert jammed.fates()["RECEIVED"] < clear["RECEIVED"]


def test_jammer_changes_only_the_fates_of_jammed_packets():
    """A jammer changes the fates of those that it drowns alone, as no robot here waits for the medium to be free."""
    radio = replace(with_access("aloha"), send_offset="uniform")
    jammed = ran(make_medium(radio, 6), CROWD, TO_FIRST, jammers({"power_dbm": NOISE_DBM + NEAR_LOSS_DB}))
    clear = ran(make_medium(radio, 6), CROWD, TO_FIRST, Jammers.none())
    assert set(received(jammed)) < set(received(clear))
    drowned = len(received(clear)) - len(received(jammed))
    assert jammed.fates()["JAMMED"] == pytest.approx(drowned, rel=0.1)


def test_jammer_too_weak_to_matter_changes_nothing():
    radio = replace(with_access("csma-802154"), send_offset="uniform", shadowing=Shadowing())
    pose = scattered(12) * [20.0, 20.0, 1.0]
    weak = jammers({"power_dbm": -100.0, "x_m": 500.0, "on_ns": 10**6, "period_ns": 3 * 10**6})
    jammed, clear = (ran(make_medium(radio, 12), pose, everybody(12)(0), now) for now in (weak, Jammers.none()))
    assert received(jammed) == received(clear)


def test_jammer_drowns_exactly_the_frames_that_overlap():
    """A frame of 57 bytes takes 1.8 ms; the jammer is on for 20 ms of 50."""
    radio = replace(with_access("aloha"), send_offset="uniform")
    now = jammers({"on_ns": 20 * 10**6, "period_ns": 50 * 10**6, "phase_ns": 7 * 10**6})
    result = ran(make_medium(radio, 2), CROWD[:2], packets([1], 0, size=40), now, ticks=300)
    on_air_ns, fate = result.on_air("on_air_at_ns"), result.on_air("fate")
    end_ns = result.on_air("final_at_ns")
    in_period_ns = (on_air_ns - 7 * 10**6) % (50 * 10**6)
    overlaps = (in_period_ns < 20 * 10**6) | (in_period_ns + end_ns - on_air_ns > 50 * 10**6)
    assert set(fate[overlaps].tolist()) == {int(Fate.JAMMED)}
    assert set(fate[~overlaps].tolist()) == {int(Fate.RECEIVED)}
    begins_clear = overlaps & (in_period_ns >= 20 * 10**6)
    assert begins_clear.sum() > 3, "some frames are drowned on the way"


def test_jammer_blocks_carrier_sense():
    """CSMA gives up; DCF waits for a gap, and sends in it."""
    csma = ran(make_medium(with_access("csma-802154"), 2), at((0, 0), (5, 0)), packets([0, 1]), jammers({}))
    assert csma.fates() == {"CHANNEL_BUSY": 40}
    dcf = with_access("dcf")
    always = ran(make_medium(dcf, 2), at((0, 0), (5, 0)), packets([0, 1]), jammers({}), ticks=5)
    assert always.fates() == {"IN_FLIGHT": 10}
    gaps = jammers({"on_ns": 60 * 10**6, "period_ns": 10**8})
    result = ran(make_medium(dcf, 2), at((0, 0), (5, 0)), packets([0]), gaps)
    assert result.fates() == {"RECEIVED": 20}
    assert (result.on_air("on_air_at_ns") % 10**8 >= 60 * 10**6).all()


def test_jammer_carried_by_a_robot_spares_it_and_drowns_neighbours():
    radio = replace(with_access("aloha"), send_offset="uniform")
    pose, sent = at((0, 0), (3, 0), (2000, 0), (2003, 0)), packets([0, 1, 2, 3])
    alone = received(ran(make_medium(radio, 4), pose, sent, Jammers.none()))
    for carrier, spared in ((0, {0, 2, 3}), (2, {0, 1, 2})):
        result = ran(make_medium(radio, 4), pose, sent, jammers({"carrier": carrier}))
        assert {receiver for receiver, _, _ in received(result)} <= spared
        assert result.fates()["JAMMED"] > 0
        assert {row for row in received(result) if row[0] == carrier} == {row for row in alone if row[0] == carrier}


@pytest.mark.parametrize("change", [{"walls": Walls(60.0)}, {"line_of_sight": True}])
def test_jammer_is_blocked_by_walls_and_obstacles(change: dict[str, Any]):
    radio, wall = with_access("aloha"), [Obstacle("box", 1.5, 0.0, size_m=(0.2, 4.0))]
    bare, blocked = (
        ran(make_medium(radio_, 2, obstacles=[wall]), at((0, 0), (1, 0)), packets([0]), jammers({"x_m": 2.0})).fates()
        for radio_ in (radio, replace(radio, **change))
    )
    assert "RECEIVED" not in bare
    assert blocked == {"RECEIVED": 20}


@pytest.mark.parametrize(("on_ms", "joined"), [(50, True), (95, False), (100, False)])
def test_jammer_removes_edges_by_its_duty_cycle(on_ms: int, joined: bool):
    """`min_delivery` is a tenth: of a packet's tries one in ten must meet no jammer."""
    now = jammers({"on_ns": on_ms * 10**6, "period_ns": 10**8})
    result = ran(make_medium(with_access("aloha"), 2), at((0, 0), (20, 0)), packets([0]), now, ticks=1)
    assert result.edges.tolist() == ([[0, 1]] if joined else [])


def run_unicast(radio: Radio, plan: Plan, *, sends: int = 1, metres: float = 1.0) -> Run:
    """Robot 0 sends to robot 1 in the first ticks, while disruptions go by plan(tick)."""

    def sent_in(tick: int) -> SentPackets:
        return replace(packets([0], 1, 100), tx_status_id=np.array([tick])) if tick < sends else SentPackets.none()

    now = {tick: Disruption.none(2) for tick in range(12)}
    for tick, disruption in now.items():
        for name, value in plan(tick).items():
            setattr(disruption, name, np.array(value, getattr(disruption, name).dtype))
    return run(make_medium(radio, 2), at((0, 0), (metres, 0)), sent_in, 11, now=now)


def departures(out: Run) -> list[tuple[int, int]]:
    """Sequence and fate of each packet that left its radio."""
    return out.rows("departed", "sequence", "fate")


@pytest.mark.parametrize("end", ["alive", "radio_on"])
@pytest.mark.parametrize(
    ("radio", "metres", "fate"),
    [(SLOW, 1.0, "RECEIVED"), (replace(SLOW, loss=1.0), 1.0, "LOST"), (SLOW, 5000.0, "OUT_OF_RANGE")],
    ids=["received", "lost", "far"],
)
def test_packet_on_air_keeps_its_fate_when_its_sender_ends(radio: Radio, metres: float, fate: str, end: str):
    """Robot 0 is deaf to the acknowledgement, tries again, and dies, or its radio goes off."""
    out = run_unicast(radio, lambda tick: {"receive_gain_db": [-200.0, 0.0], end: [tick < 2, True]}, metres=metres)
    assert out.fates() == {fate: 1}
    assert departures(out) == [(0, int(Fate.RECEIVED))]
    assert out.tally.in_range.tolist() == [int(fate != "OUT_OF_RANGE")]


def test_acknowledgement_wait_scales_at_low_bit_rates():
    out = run_unicast(SLOW, lambda _: {})
    assert out.rows("tx_status", "id", "result") == [(0, TxResult.ACKNOWLEDGED)]


def test_tx_status_is_dropped_after_death_and_revival():
    """A frame of 234 ms; the robot is dead in one tick of it."""
    out = run_unicast(replace(SLOW, bit_rate_bps=4_000), lambda tick: {"alive": [tick != 1, True]})
    assert out.fates() == {"RECEIVED": 1}
    assert not len(out.tx_status("id"))


def test_backlog_of_newest_keeps_one_packet_across_a_failed_attempt():
    backlog = {"backlog": [NEWEST, NEWEST]}
    out = run_unicast(
        replace(SLOW, loss=1.0), lambda tick: {**backlog, "radio_on": [not 1 <= tick <= 3, True]}, sends=2
    )
    assert [sequence for sequence, _ in departures(out)] == [0, 1]
    assert out.fates() == {"LOST": 2}
    first, second = (next(k for k, step in enumerate(out.news) if s in step.departed.sequence) for s in (0, 1))
    assert first <= 3 < second


def test_broadcast_without_receivers_departs():
    medium = make_medium(with_access("csma-802154"), 1)
    medium.step(0, at((0, 0)))
    medium.send(0, 0, packets([0], -1, 10))
    news = medium.step(TICK_NS, at((0, 0)))
    assert news.departed.sequence.tolist() == [0]
