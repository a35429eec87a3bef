"""Antenna patterns: strengths by heading and elevation against closed forms and ns-3's values, reciprocity, and where
patterns count: interference, jammers, the radio graph, events, interpolated positions and coverage."""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, log10, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.radio.analysis.coverage import RadioCoverage, coverage_map
from swarmwire.comms.radio.config.antennas import Antenna, Antennas, GainTable, Pattern, RobotAntenna
from swarmwire.comms.radio.config.checks import check_radio
from swarmwire.comms.radio.config.impairments import Measures, RssiMeasure
from swarmwire.comms.radio.config.phy import Reception
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import with_number
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import Disruption, Jammers
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.comms.radio.propagation.antennas import antenna_patterns, direction_loss_db
from tests.support.comms.radio import (
    RATE_HZ,
    SIZE_M,
    TICK_NS,
    Run,
    at,
    everybody,
    jammed_by,
    jammers,
    packets,
    run,
    scattered,
    story,
    with_access,
)
from tests.support.refusals import refused_input

POWER_DBM = 60.0  # enough for a link between the backs of two antennas
RADIO = replace(
    with_access("none"), measures=Measures(rssi=RssiMeasure()), antenna=Antenna(POWER_DBM), send_offset="tick"
)
OMNIDIRECTIONAL = RobotAntenna(pattern=Pattern())
PATCH = Pattern("patch")
APART_M = 3.0
LOSS_DB = 46.6777 + 30.0 * log10(APART_M)
# ns-3's CosineAntennaModel with a beam of 90 degrees: gain by azimuth, from ns-3 3.44.
COSINE = {0: 0.0, 15: -0.325560973, 30: -1.31362862, 45: -3.0, 60: -5.450341436, 90: -13.132166241, 120: -26.264332481}


def patterned(pattern: Pattern | None, **changes: float) -> Radio:
    """The radio with this pattern."""
    return replace(RADIO, antenna=Antenna(POWER_DBM, pattern=pattern, **changes))


def medium_of(radio: Radio, groups: Sequence[RobotAntenna | None], seed: int = 1) -> RadioMedium:
    """A medium whose robots have an antenna each."""
    context = ChannelContext.open_space(radio, np.array([derive_key(seed, "air")], np.uint64), len(groups), SIZE_M)
    return RadioMedium(replace(context, antennas=Antennas.of_groups([(1, group) for group in groups])), RATE_HZ)


def strengths_dbm(
    radio: Radio, poses: Sequence[FloatArray], groups: Sequence[RobotAntenna | None] = (None, OMNIDIRECTIONAL)
) -> FloatArray:
    """Strength from robot 0 to robot 1, and back, at each pose, (k, 2)."""
    medium, measured = medium_of(radio, groups), list[list[float]]()
    for pose in poses:
        result = run(medium, pose, lambda _: packets([0, 1]), 1)
        links = result.rows("received", "sender_index", "receiver")
        rssi_dbm = dict(zip(links, result.measured("rssi_dbm").tolist(), strict=True))
        measured.append([rssi_dbm[0, 1], rssi_dbm[1, 0]])
        medium = medium_of(radio, groups)
    return np.array(measured)


def turned(*headings_deg: float) -> list[FloatArray]:
    """Poses of two robots along x, the first one with these headings."""
    return [at((0, 0, radians(heading)), (APART_M, 0)) for heading in headings_deg]


def climbed(*elevations_deg: float) -> list[FloatArray]:
    """Poses of two robots, the second one seen under these elevations from the first."""
    up = [(APART_M * cos(radians(deg)), APART_M * sin(radians(deg))) for deg in elevations_deg]
    return [np.array([[0, 0, 0, 0], [x, 0, 0, z]], np.float64) for x, z in up]


@pytest.mark.parametrize(
    ("beam_width_deg", "azimuth_deg", "max_loss_db", "gain_db"),
    [
        (65.0, 0.0, 30.0, {0: 0.0, 10: -0.284023668, 30: -2.556213018, 45: -5.75147929, 77: -16.839763312, 180: -30.0}),
        (60.0, 0.0, 20.0, {0: 0.0, 30: -3.0, 45: -6.75, -60: -12.0, 77: -19.763333333, 120: -20.0}),
        (70.0, 45.0, 25.0, {0: -4.959183673, 10: -3.0, 30: -0.551020408, 45: 0.0, -60: -25.0, 120: -13.775510204}),
    ],
)
def test_patch_gains_by_azimuth_are_those_of_ns3s_parabolic_antenna(
    beam_width_deg: float, azimuth_deg: float, max_loss_db: float, gain_db: dict[int, float]
):
    """Of ns-3 3.44, which rounds angles in its last digits. A robot sees the other at minus its heading."""
    pattern = Pattern("patch", azimuth_deg, beam_width_deg=beam_width_deg, max_loss_db=max_loss_db)
    strength_dbm = strengths_dbm(patterned(pattern), turned(*(-float(azimuth) for azimuth in gain_db)))
    np.testing.assert_allclose(strength_dbm[:, 0] - (POWER_DBM - LOSS_DB), list(gain_db.values()), atol=1e-8)


@given(
    heading_deg=st.tuples(st.floats(-180, 180), st.floats(-180, 180)),
    mounted_deg=st.floats(-180, 180),
    gain_dbi=st.floats(-3, 9),
)
def test_patch_strength_is_the_closed_form_at_each_pair_of_headings(
    heading_deg: tuple[float, float], mounted_deg: float, gain_dbi: float
):
    radio = patterned(Pattern("patch", mounted_deg), gain_dbi=gain_dbi)
    pose = at((0, 0, radians(heading_deg[0])), (APART_M, 0, radians(heading_deg[1])))
    off_deg = (
        (toward_deg - heading - mounted_deg + 180.0) % 360.0 - 180.0
        for toward_deg, heading in zip((0.0, 180.0), heading_deg, strict=True)
    )
    expected_dbm = POWER_DBM + 2.0 * gain_dbi - LOSS_DB - sum(min(12.0 * (deg / 65.0) ** 2, 30.0) for deg in off_deg)
    strength_dbm = strengths_dbm(radio, [pose], (None, None))
    np.testing.assert_allclose(strength_dbm, [[expected_dbm, expected_dbm]], atol=1e-9)


def test_patch_loses_3_db_at_the_edges_of_its_beam():
    pattern = replace(PATCH, beam_width_deg=80.0, beam_height_deg=40.0)
    sideways = strengths_dbm(patterned(pattern), turned(0, 40, -40))[:, 0]
    upwards = strengths_dbm(patterned(pattern), climbed(0, 20, -20))[:, 0]
    np.testing.assert_allclose(sideways[0] - sideways, [0.0, 3.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(upwards[0] - upwards, [0.0, 3.0, 3.0], atol=1e-9)


def test_patch_that_is_tilted_up_sees_robots_above():
    sky = strengths_dbm(patterned(replace(PATCH, elevation_deg=90.0)), climbed(90.0, 0.0, 57.5, -90.0))[:, 0]
    expected_db = [0.0, 12.0 * (90.0 / 65.0) ** 2, 3.0, 30.0]
    np.testing.assert_allclose(POWER_DBM - LOSS_DB - sky, expected_db, atol=1e-9)
    tilted = strengths_dbm(patterned(replace(PATCH, elevation_deg=30.0)), climbed(30.0, 62.5, 0.0))[:, 0]
    np.testing.assert_allclose(tilted[0] - tilted, [0.0, 3.0, 12.0 * (30.0 / 65.0) ** 2], atol=1e-9)


def test_dipole_has_2_15_dbi_around_and_3_db_less_39_degrees_up():
    """Balanis, 4.6: directivity 2.15 dBi, half-power beam width 78 degrees."""
    radio = patterned(Pattern("dipole", max_loss_db=50.0))
    around = strengths_dbm(radio, turned(0, 45, 90, 180), (None, None))
    np.testing.assert_allclose(around, POWER_DBM - LOSS_DB + 2.0 * 2.15, atol=2e-3)
    up_deg = 0.0, 30.0, 39.0, 60.0, 85.0, 90.0
    strength_dbm = strengths_dbm(radio, climbed(*up_deg))[:, 0]
    formula_db = [20.0 * log10(cos(pi / 2.0 * sin(radians(deg))) / cos(radians(deg))) for deg in up_deg[:-1]]
    np.testing.assert_allclose(strength_dbm - strength_dbm[0], [*formula_db, -50.0], atol=1e-9)
    assert strength_dbm[2] - strength_dbm[0] == pytest.approx(-3.0, abs=0.02)


@pytest.mark.parametrize("tilt_deg", [0.0, 35.0])
def test_dipole_radiates_as_much_as_it_gets(tilt_deg: float):
    """Its gain has the mean 1 over all directions."""
    antenna = Antenna(pattern=Pattern("dipole", 20.0, tilt_deg, max_loss_db=200.0))
    patterns = antenna_patterns([antenna], np.zeros(1, np.int64))
    steps = 120
    up = 2.0 * (np.arange(steps) + 0.5) / steps - 1.0  # rings of equal areas
    around = 2.0 * pi * (np.arange(2 * steps) + 0.5) / (2 * steps)
    loss_db = [
        direction_loss_db(patterns, 0, 0.3, (1.0 - z * z) ** 0.5 * cos(a), (1.0 - z * z) ** 0.5 * sin(a), z)
        for z in up
        for a in around
    ]
    assert np.mean(10.0 ** (0.1 * (antenna.peak_dbi - np.array(loss_db)))) == pytest.approx(1.0, abs=1e-4)


def test_dipole_that_lies_is_deaf_along_its_axis():
    """Its main direction is up, so that its axis lies along the heading."""
    radio = patterned(Pattern("dipole", elevation_deg=90.0))
    ahead, aside = strengths_dbm(radio, turned(0, 90))[:, 0]
    assert aside - ahead == pytest.approx(30.0, abs=1e-9)


def test_table_interpolates_around_the_circle():
    """Rows of ns-3's CosineAntennaModel, and their means halfway between."""
    azimuth_deg = (*(-float(deg) for deg in reversed(COSINE) if deg), *map(float, COSINE))
    gain_db = tuple(COSINE[abs(int(deg))] for deg in azimuth_deg)
    radio = patterned(Pattern("table", table=GainTable(azimuth_deg, gain_db)))
    rows = strengths_dbm(radio, turned(*(-deg for deg in azimuth_deg)))[:, 0] - (POWER_DBM - LOSS_DB)
    np.testing.assert_allclose(rows, gain_db, atol=1e-9)
    halfway = strengths_dbm(radio, turned(-75, 52.5, 180, 150))[:, 0] - (POWER_DBM - LOSS_DB)
    expected_db = [0.5 * (COSINE[60] + COSINE[90]), 0.5 * (COSINE[45] + COSINE[60]), COSINE[120], COSINE[120]]
    np.testing.assert_allclose(halfway, expected_db, atol=1e-9)


def test_table_with_elevations_interpolates_both_ways():
    table = GainTable((0.0, 90.0, 180.0, 270.0), (0.0, -4, -8, -4, 6.0, 2.0, 2.0, 2.0), (0.0, 60.0))
    radio = patterned(Pattern("table", table=table))
    up = strengths_dbm(radio, climbed(0.0, 15.0, 60.0, 80.0, -50.0))[:, 0] - (POWER_DBM - LOSS_DB)
    np.testing.assert_allclose(up, [0.0, 1.5, 6.0, 6.0, 0.0], atol=1e-9)
    pose = [np.array([[0, 0, radians(-45), 0], climbed(30.0)[0][1]])]
    assert strengths_dbm(radio, pose)[0, 0] - (POWER_DBM - LOSS_DB) == pytest.approx(0.25 * (0 - 4 + 6 + 2), abs=1e-9)


TABLE = GainTable((-120.0, 0.0, 60.0), (-20.0, 3.0, -7.0, -12.0, 1.0, -9.0), (-30.0, 45.0))
PATTERNS = st.one_of(
    st.none(),
    st.builds(
        Pattern,
        model=st.sampled_from(["omnidirectional", "dipole", "patch"]),
        azimuth_deg=st.floats(-180, 180),
        elevation_deg=st.floats(-40, 40),
        beam_width_deg=st.floats(20, 180),
        beam_height_deg=st.floats(20, 180),
        max_loss_db=st.floats(0, 30),
    ),
    st.builds(Pattern, model=st.just("table"), azimuth_deg=st.floats(-180, 180), table=st.just(TABLE)),
)


@given(
    patterns=st.tuples(PATTERNS, PATTERNS),
    heading=st.tuples(st.floats(-pi, pi), st.floats(-pi, pi)),
    away=st.tuples(st.floats(1.5, 3), st.floats(-1, 1), st.floats(-1, 1)),  # not above an antenna, where azimuths end
    turn=st.floats(-pi, pi),
)
def test_patterns_are_reciprocal_and_turn_with_the_robots(
    patterns: tuple[Pattern | None, Pattern | None],
    heading: tuple[float, float],
    away: tuple[float, float, float],
    turn: float,
):
    x, y, z = away
    pose = np.array([[0, 0, heading[0], 3.0], [x, y, heading[1], 3.0 + z]], np.float64)
    rotated = pose.copy()
    rotated[:, 2] += turn
    rotated[1, :2] = x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn)
    groups = [RobotAntenna(pattern=pattern) for pattern in patterns]
    strength_dbm = strengths_dbm(RADIO, [pose, rotated], groups)
    np.testing.assert_allclose(strength_dbm, strength_dbm[0, 0], atol=1e-9)


def test_pattern_omnidirectional_changes_no_bit():
    pose = scattered(30)
    radio = with_access("csma-802154")
    alike, same = (
        run(medium_of(radio, [group] * 30), pose, everybody(30), 3) for group in (None, RobotAntenna(pattern=Pattern()))
    )
    assert story(alike, 30) == story(same, 30)


def test_pattern_of_a_group_replaces_that_of_the_radio():
    ahead, behind = turned(0)[0], turned(180)[0]
    radio = patterned(PATCH)
    assert np.ptp(strengths_dbm(radio, [ahead, behind], (None, OMNIDIRECTIONAL))) == pytest.approx(30.0, abs=1e-9)
    assert np.ptp(strengths_dbm(radio, [ahead, behind], (OMNIDIRECTIONAL, OMNIDIRECTIONAL))) == 0.0


def test_pattern_keeps_the_gains_of_events_and_follows_ramps():
    radio, pose = patterned(PATCH), turned(30)[0]
    now, usual = Disruption.none(2), float(strengths_dbm(radio, [pose])[0, 0])
    now.send_gain_db[:] = 5.0, 0.0
    now.receive_gain_db[:] = 0.0, -2.0
    mounted = {2: with_number(radio, "radio.antenna.pattern.azimuth_deg", -30.0)}
    medium = medium_of(radio, (None, OMNIDIRECTIONAL))
    result = run(medium, pose, lambda _: packets([0]), 3, now={1: now}, radios=mounted)
    more_db = 12.0 * (30.0 / 65.0) ** 2
    expected_dbm = [usual, usual + 3.0, usual + 3.0 + more_db]
    np.testing.assert_allclose(result.measured("rssi_dbm"), expected_dbm, atol=1e-9)


def test_pattern_sees_headings_of_interpolated_positions():
    """A robot turns by 100 degrees in a tick, and sends in the middle of the sixth tenth, at 55 degrees."""
    radio = replace(patterned(PATCH), positions="interpolated", send_offset=0.055)
    medium = medium_of(radio, (None, OMNIDIRECTIONAL))
    result, poses = Run(medium), turned(0, 100)
    result.news.append(medium.step(0, poses[0]))
    medium.send(0, 0, packets([0]))
    result.news.append(medium.step(TICK_NS, poses[1]))
    expected_dbm = POWER_DBM - LOSS_DB - 12.0 * (55.0 / 65.0) ** 2
    assert result.measured("rssi_dbm").tolist() == pytest.approx([expected_dbm], abs=1e-9)


def receives(radio: Radio, pose: FloatArray, senders: Sequence[int], held: Jammers | None = None) -> bool:
    """Whether robot 0 receives what robot 1 sends while others send, too; robot 0 alone has the pattern."""
    medium = medium_of(radio, [None, *[OMNIDIRECTIONAL] * (len(pose) - 1)])
    now = {0: jammed_by(held or Jammers.none(), len(pose))}
    result = run(medium, pose, lambda _: packets(senders), 1, 1, now)
    return (1, 0) in result.rows("received", "sender_index", "receiver")


ALOHA = replace(
    with_access("aloha"), antenna=Antenna(pattern=PATCH), reception=Reception("threshold", min_sinr_db=10.0)
)


def test_patch_that_looks_away_from_an_interferer_receives():
    """Robot 1 is ahead of robot 0 and robot 2 behind it, or the other way round, at the same distance."""
    ahead, behind, heading = (2.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    assert receives(ALOHA, at(heading, ahead, behind), [1, 2])
    assert not receives(ALOHA, at(heading, behind, ahead), [1, 2])
    assert not receives(replace(ALOHA, antenna=Antenna()), at(heading, ahead, behind), [1, 2])


@pytest.mark.parametrize(("x_m", "is_received"), [(-2.0, True), (2.0, False)])
def test_patch_that_looks_away_from_a_jammer_receives(x_m: float, is_received: bool):
    held = jammers({"x_m": x_m, "power_dbm": 10.0})
    assert receives(ALOHA, at((0, 0), (2, 0.1)), [1], held) is is_received


def test_radio_graph_joins_patches_that_face_each_other_alone():
    radio = replace(with_access("none"), antenna=Antenna(-30.0, pattern=PATCH))
    facing, away = at((0, 0, 0), (4, 0, pi)), at((0, 0, pi), (4, 0, 0))
    for pose, edges in ((facing, [[0, 1]]), (away, [])):
        assert medium_of(radio, (None, None)).step(0, pose).edges.tolist() == edges
    reach_m = range_of(replace(radio, antenna=Antenna(-30.0)))
    assert range_of(radio) == reach_m
    assert range_of(replace(radio, antenna=Antenna(-30.0, pattern=Pattern("dipole")))) == pytest.approx(
        reach_m * 10.0 ** (2.0 * 2.15088 / 30.0)
    )


def test_coverage_of_a_patch_is_that_of_the_medium():
    radio = replace(RADIO, antenna=Antenna(POWER_DBM, 1.5, pattern=PATCH), cut_off_db=60.0)
    pose = scattered(20)
    result = run(medium_of(radio, [None] * 20), pose, everybody(20), 1, 1)
    received = result.finished("fate") == 0
    sender, receiver = result.finished("sender")[received], result.finished("receiver")[received]
    key, empty = np.uint64(derive_key(1, "air")), ObstacleIndices(obstacle_arrays(((),)), SIZE_M, 0.0)
    coverage = RadioCoverage(radio, key, empty, 10)
    mean_dbm = coverage.mean_dbm(pose[sender], pose[receiver])
    assert len(sender) == 20 * 19
    np.testing.assert_allclose(mean_dbm, result.finished("rssi_dbm")[received], atol=1e-9)
    best_dbm = coverage.mean_dbm(pose[sender, :2], pose[receiver, :2])
    assert mean_dbm is not None
    assert best_dbm is not None
    assert ((best_dbm - mean_dbm) >= 0.0).all()
    around = coverage_map(coverage, SIZE_M, (0.0, 0.0), 24, heading_rad=pi / 2.0)
    assert around.mean_dbm is not None
    assert around.mean_dbm[-1, 12] - around.mean_dbm[0, 12] == pytest.approx(30.0, abs=0.1)


@pytest.mark.parametrize(
    ("key", "pattern"),
    [
        ("azimuth_deg", Pattern(azimuth_deg=3.0)),
        ("beam_width_deg", Pattern("dipole", beam_width_deg=30.0)),
        ("max_loss_db", Pattern("table", max_loss_db=3.0, table=TABLE)),
        ("table", Pattern("table")),
        ("table", Pattern("patch", table=TABLE)),
        ("table.azimuth_deg", Pattern("table", table=GainTable((0.0, 360.0), (1.0, 2.0)))),
        ("table.azimuth_deg", Pattern("table", table=GainTable((), ()))),
        ("table.elevation_deg", Pattern("table", table=GainTable((0.0,), (1.0, 2.0), (0.0, 91.0)))),
        ("table.elevation_deg", Pattern("table", table=GainTable((0.0,), (1.0, 2.0), (3.0, 2.0)))),
        ("table.gain_db", Pattern("table", table=GainTable((0.0, 1.0), (1.0,)))),
        ("table.gain_db", Pattern("table", table=GainTable((0.0,), (900.0,)))),
    ],
)
def test_pattern_with_keys_that_contradict_is_refused(key: str, pattern: Pattern):
    with refused_input("a.toml", f"radio.antenna.pattern.{key}"):
        check_radio(patterned(pattern), "a.toml")
