"""Presets of real radios, and the coverage that a radio reaches."""

import math
from dataclasses import MISSING, fields, is_dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.config import bounds_of, fault_of
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.analysis.contention import Contention, contention
from swarmwire.comms.radio.analysis.coverage import RadioCoverage, by_distance, coverage_map
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.frames import acknowledgement_ns, airtime_ns
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Access, Fading, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.propagation import cut_off_dbm, range_of, receiver_for, sensitivity_of
from swarmwire.comms.radio.propagation.path_loss import loss_db
from swarmwire.comms.radio.reception.receiver import chunk_success
from tests.support.comms.radio import (
    IEEE_802_15_4,
    MODULES,
    OBSTACLES,
    SIZE_M,
    at,
    everybody,
    make_medium,
    packets,
    run,
    scattered,
)
from tests.unit.world.scenario.test_bodies import radio_of

NEW = ("ble-1M", "crazyradio-250k", "crazyradio-1M", "crazyradio-2M", "kilobot", "gz-rfcomms", "subt", "acoustic")
GAZEBO = ("gz-rfcomms", "subt")
PARAMETERS = {
    value
    for module in MODULES
    for value in vars(import_module(module)).values()
    if isinstance(value, type) and is_dataclass(value) and value.__module__ == module
}
DISK = Radio(2.5, loss=0.1, bursts=Bursts(1.0, 9.0))
# So weak that a few metres decide.
WEAK = replace(IEEE_802_15_4, antenna=Antenna(-42.0), access=Access("none"), min_delivery=0.3)
SHADED = replace(WEAK, walls=Walls(6.0, 3.0), shadowing=Shadowing(6.0, 1.0))
ROBOTS = 40


def preset(name: str, **others: Any) -> Radio:
    return radio_of({"preset": name, **others})


@pytest.mark.parametrize(
    ("name", "mbps", "us"),
    [
        *(("ieee802154", 0.25, 352), ("wifi-b-1M", 1, 304), ("wifi-b-1M", 11, 203)),
        *(("wifi-a-6M", 6, 44), ("wifi-a-6M", 9, 44), ("wifi-a-6M", 54, 28)),
        *(("wifi-n-5G", 6.5, 44), ("wifi-n-5G", 19.5, 32), ("wifi-n-5G", 65, 28), ("wifi-n-2G", 65, 34)),
    ],
)
def test_acknowledgement_airtime_matches_the_standard(name: str, mbps: float, us: int):
    """At the highest mandatory rate that is no higher than that of the frame: 6, 12 or 24 Mbit/s of OFDM."""
    assert acknowledgement_ns(preset(name, bit_rate_bps=round(1e6 * mbps))) == us * 1000


@pytest.mark.parametrize(("lifetime_s", "received"), [(None, 40), (0.5, 13), (0.02, 1)])
def test_packets_beyond_the_queue_lifetime_are_dropped(lifetime_s: float | None, received: int):
    """Frames of 40.6 ms at once, with access 40.7 to 41.3 ms: after 0.5 s the 13th is the last that begins."""
    radio = preset("wifi-b-1M", queue_limit=100, send_offset="tick", max_payload_bytes=6000, overhead_bytes=0)
    radio = replace(radio, queue_lifetime_s=lifetime_s)
    result = run(make_medium(radio, 2), at((0, 0), (1, 0)), lambda _: packets([0] * 40, size=5050), 1, 20)
    dropped = {"QUEUE_FULL": 40 - received} if received < 40 else {}
    assert result.fates() == {"RECEIVED": received, **dropped}


def in_one_spot(radio: Radio, nodes: int, payload_bytes: int, interval_s: float, runs: int) -> Contention:
    return contention(radio, nodes, payload_bytes, interval_s, range(1, runs + 1), measured_s=4.0 * interval_s)


@pytest.mark.parametrize(
    ("name", "payload_bytes", "us"),
    [
        ("ble-1M", 27, 376.0),  # 31 bytes of data and 6 of address: the longest legacy advertisement
        ("kilobot", 11, 3200.0),  # 12 bytes at 30 kbit/s
        ("acoustic", 64, 1_100_000.0),  # 512 bits at 463 bit/s take 1.106 s
        ("gz-rfcomms", 1500, 222.223),
        ("subt", 1500, 12_000.0),
    ],
)
def test_longest_frame_airtime_matches_the_source(name: str, payload_bytes: int, us: float):
    radio = preset(name)
    assert radio.max_payload_bytes == payload_bytes
    assert airtime_ns(radio, np.array([payload_bytes + radio.overhead_bytes])) == pytest.approx([1e3 * us], rel=1e-6)


@pytest.mark.parametrize("name", NEW)
def test_preset_pair_hears_within_its_range_only(name: str):
    """Without shadowing, which would make it a question of place; frames of 4 bytes."""
    radio = replace(preset(name), shadowing=None, send_offset="tick")
    range_m = range_of(radio)
    assert range_m is not None
    for share, received in ((0.5, True), (1.3, False)):
        # One sends: two modems that call at once would not hear each other.
        result = run(make_medium(radio, 2), at((0, 0), (share * range_m, 0)), lambda _: packets([0], size=4), 1, 60)
        assert result.fates() == ({"RECEIVED": 1} if received else {"OUT_OF_RANGE": 1})


@pytest.mark.parametrize("bit_rate_bps", [1_000_000, 2_000_000, 11_000_000])
def test_wifi_b_range_is_that_of_its_preamble(bit_rate_bps: int):
    """ns-3's -82 dBm: up to 2 Mbit/s and 11 alike, all bits of a frame that is found are right."""
    radio = preset("wifi-b-1M", send_offset="tick", bit_rate_bps=bit_rate_bps)
    range_m = range_of(radio)
    assert range_m is not None
    assert sensitivity_of(radio) == -82.0
    for share, fate in ((0.99, "RECEIVED"), (1.01, "OUT_OF_RANGE")):
        result = run(make_medium(radio, 2), at((0, 0), (share * range_m, 0)), lambda _: packets([0] * 20, size=4), 1, 1)
        assert result.fates() == {fate: 20}


def test_sensitivity_includes_preamble_detection():
    """A frame of 802.11b at 1 Mbit/s would be right at -93 dBm, but at 4 dB over -93.55 dBm its preamble is found."""
    radio = preset("wifi-b-1M", reception={"preamble_dbm": -200.0})
    assert sensitivity_of(radio) == pytest.approx(radio.noise_or_default.power_dbm + 4.0)


def test_ble_has_a_bit_error_rate_of_0_001_at_its_sensitivity():
    radio = preset("ble-1M")
    sinr = 10.0 ** (0.1 * (sensitivity_of(radio) - radio.noise_or_default.power_dbm))
    assert 1.0 - chunk_success(receiver_for(radio), sinr, 1) == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize("name", GAZEBO)
@pytest.mark.parametrize("sinr_db", [3.25, 5.0, 6.25, 8.0, 9.75])
def test_gazebo_loss_matches_its_formula(name: str, sinr_db: float):
    sinr = 10.0 ** (0.1 * sinr_db)
    success = chunk_success(receiver_for(preset(name)), sinr, 8 * 100)
    assert success == pytest.approx((1.0 - math.erfc(math.sqrt(sinr))) ** 100, rel=1e-9)


def test_gazebo_presets_have_their_noise_path_loss_and_range():
    assert [preset(name).noise_or_default.power_dbm for name in GAZEBO] == pytest.approx([-90.0, -90.0], abs=1e-3)
    assert [range_of(preset(name)) for name in GAZEBO] == [50.0, 500.0]
    gazebo, subt = (preset(name).path_loss_model.curve(2.4e9) for name in GAZEBO)
    for distance_m in (2.0, 30.0, 400.0):
        assert loss_db(gazebo, distance_m) == pytest.approx(40.0 + 25.0 * math.log10(distance_m))
        assert loss_db(subt, distance_m) == pytest.approx(40.0 + 15.0 * math.log10(0.55 * distance_m), abs=1e-3)


def test_acoustic_preset_has_thorp_absorption_and_range():
    radio = preset("acoustic")
    curve, range_m = radio.path_loss_model.curve(radio.frequency_hz), range_of(radio)
    # Thorp at 28 kHz: 0.11 f2/(1 + f2) + 44 f2/(4100 + f2) + 0.000275 f2 + 0.003 dB/km, f2 = 784.
    assert loss_db(curve, 1000.0) == pytest.approx(60.0 + 7.39, abs=0.05)
    assert range_m is not None
    assert 3000.0 < range_m < 4000.0
    assert loss_db(curve, range_m) == pytest.approx(27.2 - sensitivity_of(radio), abs=1e-6)


@pytest.mark.parametrize("model", ["unit-disk", "log-distance"])
def test_propagation_speed_delays_reception_by_distance(model: str):
    """150 m at 1500 m/s take 100 ms, 75 m half of it; of the unit disk and of a PHY."""
    pose = at((0, 0), (75, 0), (150, 0))
    radio = Radio(200.0, model=model, send_offset="tick", latency_s=0.01, bit_rate_bps=10**6)
    for speed_mps, later_ns in ((None, [0, 0]), (1500.0, [50_000_000, 100_000_000])):
        slow = replace(radio, propagation_mps=speed_mps)
        result = run(make_medium(slow, 3), pose, lambda _: packets([0]), 1, 3)
        assert (result.received("received_at_ns") - 10_000_000 - 80_000).tolist() == later_ns


def test_acoustic_fading_uses_its_own_wavelength():
    """28 kHz at 1500 m/s have 5.36 cm, as 5.6 GHz have in air: the same strengths, to the last bit."""
    strengths = []
    for waves in ({"frequency_hz": 30e3, "propagation_mps": 3e3}, {"frequency_hz": 3e9, "propagation_mps": 3e8}):
        radio = preset("acoustic", fading={"distribution": "rayleigh"}, measures={"rssi": {}}, **waves)
        result = run(make_medium(radio, 3), at((0, 0), (10, 0), (0, 14)), lambda _: packets([0], size=4), 1, 20)
        strengths.append(result.measured("rssi_dbm").tolist())
    assert len(strengths[0]) == 2
    assert strengths[0] == strengths[1]


def test_kilobot_listens_before_it_sends():
    """20 in one spot, twice a second, as Kilobots do: without carrier sense a fifth would be lost."""
    measured = in_one_spot(preset("kilobot"), 20, 11, 0.5, runs=20)
    blind = in_one_spot(replace(preset("kilobot"), access=Access("aloha")), 20, 11, 0.5, runs=20)
    assert blind.pdr == pytest.approx((1.0 - 2.0 * 3.2 / 500.0) ** 19, abs=0.05)
    assert measured.pdr > 0.95


@pytest.mark.parametrize("name", GAZEBO)
def test_gazebo_radios_never_interfere(name: str):
    assert in_one_spot(replace(preset(name), send_offset="tick"), 10, 100, 0.1, runs=1).pdr == 1.0


def test_acoustic_modems_that_send_at_once_hear_nothing():
    together = in_one_spot(replace(preset("acoustic"), send_offset="tick"), 2, 4, 1.0, runs=2)
    assert together.pdr == 0.0
    assert 0.2 < in_one_spot(preset("acoustic"), 2, 4, 1.0, runs=20).pdr < 0.6


@pytest.mark.parametrize("kind", sorted(PARAMETERS, key=lambda kind: kind.__name__))
def test_radio_defaults_are_within_bounds_and_have_help(kind: type):
    for field in fields(kind):
        limits = bounds_of(field)
        if "bounds" not in field.metadata:
            continue
        assert limits.help, field.name
        if isinstance(field.default, int | float):
            assert fault_of(field.default, limits) is None, field.name
        if limits.choices and field.default not in (MISSING, None):
            assert field.default in limits.choices, field.name


def coverage_of(radio: Radio, obstacles: list[Obstacle] | None = None, payload_bytes: int = 10) -> RadioCoverage:
    """Of the arena with seed 1."""
    key = derive_key(1, "air")
    placed = ObstacleIndices(obstacle_arrays((tuple(obstacles or ()),)), SIZE_M, 0.0)
    return RadioCoverage(radio, np.uint64(key), placed, payload_bytes)


@pytest.mark.parametrize(
    "radio", [DISK, replace(DISK, line_of_sight=False), WEAK, SHADED, replace(SHADED, range_m=2.0)]
)
def test_radio_graph_has_the_pairs_with_enough_delivery(radio: Radio):
    pose = scattered(ROBOTS)
    medium = make_medium(radio, ROBOTS, obstacles=[OBSTACLES])
    edges = medium.step(0, pose).edges
    a, b = np.triu_indices(ROBOTS, 1)
    coverage = coverage_of(radio, OBSTACLES, radio.max_payload_bytes)
    joined = coverage.delivery(pose[a, :2], pose[b, :2]) >= radio.min_delivery - 1e-9
    np.testing.assert_array_equal(edges, np.stack([a[joined], b[joined]], axis=1))
    assert 50 < len(edges) < len(a) - 50


def test_coverage_mean_rssi_equals_that_of_received_packets():
    pose = scattered(ROBOTS)
    result = run(make_medium(SHADED, ROBOTS, obstacles=[OBSTACLES]), pose, everybody(ROBOTS), 1, 1)
    received = result.finished("fate") == 0
    sender, receiver = result.finished("sender")[received], result.finished("receiver")[received]
    mean_dbm = coverage_of(SHADED, OBSTACLES).mean_dbm(pose[sender, :2], pose[receiver, :2])
    assert len(sender) > 200
    assert mean_dbm is not None
    # The medium's links have their shadowing in single precision.
    off_db = np.abs(result.finished("rssi_dbm")[received] - mean_dbm)
    assert np.median(off_db) < 1e-4
    assert off_db.max() < 0.1


@pytest.mark.parametrize("fading", [None, Fading("rayleigh"), Fading("rician", k=3.0), Fading("nakagami", m=0.7)])
def test_coverage_delivery_is_the_share_of_lone_packets_received(fading: Fading | None):
    """A pair in each of a thousand arenas, whose fading is their own, where about half of the packets get through."""
    radio, x_m = replace(WEAK, fading=fading), np.linspace(-2.0, 2.9, 500)
    end = np.stack([x_m, np.zeros(500)], axis=1)
    delivery = coverage_of(radio).delivery(np.broadcast_to(np.array([-2.9, 0.0]), end.shape), end)
    halfway = int(np.argmin(np.abs(delivery - 0.5)))
    expected, pose = float(delivery[halfway]), at((-2.9, 0.0), (x_m[halfway], 0.0))
    medium = make_medium(radio, 2, range(1000))
    result = run(medium, np.tile(pose, (1000, 1)), lambda _: packets(range(0, 2000, 2)), 1, 1)
    share = len(result.received("receiver")) / 1000
    assert 0.3 < expected < 0.7
    # The coverage's own sample of gains, twice as many, has an error, too.
    assert abs(share - expected) < 4.4 * np.sqrt(1.5 * expected * (1.0 - expected) / 1000)


def test_coverage_delivery_is_zero_below_the_cut_off():
    """Fading lifts some packets above the noise from just below it.

    The medium leaves such links out if it is told to.
    """
    near, far = (replace(WEAK, fading=Fading("rayleigh"), cut_off_db=below_db) for below_db in (0.0, 10.0))
    end = np.stack([np.linspace(1.0, 20.0, 500), np.zeros(500)], axis=1)
    mean_dbm = coverage_of(near).mean_dbm(np.zeros_like(end), end)
    assert mean_dbm is not None
    below = np.flatnonzero(mean_dbm < cut_off_dbm(near))[:1]
    delivery = [coverage_of(radio).delivery(np.zeros((1, 2)), end[below])[0] for radio in (near, far)]
    assert delivery[0] == 0.0
    assert delivery[1] > 0.01


def test_coverage_map_shows_range_shadow_and_obstacles():
    coverage = coverage_map(coverage_of(DISK, OBSTACLES), SIZE_M, (0.0, 0.0), 60)
    assert coverage.delivery.shape == coverage.in_range.shape == (len(coverage.y_m), len(coverage.x_m)) == (50, 60)
    x_m, y_m = np.meshgrid(coverage.x_m, coverage.y_m)
    covered = np.hypot(x_m - 0.5, y_m - 0.5) < 0.4
    assert not coverage.is_free[covered].any()
    assert not coverage.in_range[np.hypot(x_m, y_m) > 2.5].any()
    behind = (np.hypot(x_m - y_m, 0.0) < 0.2) & (x_m > 0.9)
    assert behind.any()
    assert not coverage.in_range[behind].any()
    clear = (np.hypot(x_m, y_m) < 2.4) & (y_m > 0.1) & (x_m < 0.0)
    assert coverage.in_range[clear].all()
    assert np.unique(coverage.delivery[coverage.in_range]).tolist() == pytest.approx([0.9 * 0.9])
    assert coverage.mean_dbm is None
    assert 0.4 < coverage.share(coverage.in_range) < 0.65


def test_coverage_by_distance_ends_at_the_range_or_falls():
    key = np.uint64(7)
    of_disk = by_distance(coverage_of(replace(DISK, bursts=None, loss=0.0)), SIZE_M, key, 20.0, 80)
    assert of_disk.mean_dbm is None
    np.testing.assert_array_equal(of_disk.delivery.mean, of_disk.distance_m < 2.5)
    assert 5.0 < of_disk.distance_m[-1] < np.hypot(*SIZE_M)
    bare, shaded = (by_distance(coverage_of(radio, OBSTACLES), SIZE_M, key, 6.0, 20) for radio in (WEAK, SHADED))
    assert (np.diff(bare.delivery.mean) <= 0.0).all()
    np.testing.assert_allclose(bare.delivery.low, bare.delivery.high, atol=1e-9)
    assert (shaded.delivery.low <= shaded.delivery.high).all()
    assert (shaded.delivery.high - shaded.delivery.low).max() > 0.5
    assert bare.mean_dbm is not None
    assert shaded.mean_dbm is not None
    assert (shaded.mean_dbm.mean < bare.mean_dbm.mean - 0.5)[10:].all()
