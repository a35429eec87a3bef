"""Fits find again what logs were made with. Keys are fixed; tolerances are standard errors as the fit itself states
them, at most four of them (false alarm 1 in 16 000 each), and those are held to what such a log can tell.
"""

import numpy as np
import pytest

from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.impairments import Bursts, bursts_from_steps
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.deploy.cli.actions.radio_fit import FitRow, parameter_rows, radio_table, residual_rows
from swarmwire.metrics.real.radio_fit.fit import fit_radio
from swarmwire.metrics.real.radio_fit.logs import loss_sequences, read_log
from swarmwire.metrics.real.radio_fit.losses import LossFit, expected_runs, fit_losses
from swarmwire.metrics.real.radio_fit.path_loss import PathLossFit
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit, link_covariance
from tests.support.metrics.radio import EXPONENT, NOISE_DB, RSSI_AT_1_M_DBM, csv_of, losses, made, sequences

STANDARD_ERRORS = 4.0
SHADOWING = Shadowing(4.0, 5.0)
BURSTS = Bursts(0.5, 5.0, 0.8, 0.02)


def is_found(estimate, true: float, surely: float) -> bool:
    """Whether a value is right by its own standard error, which is at most such a share of it."""
    value, error = estimate
    return bool(abs(value - true) < STANDARD_ERRORS * error and error < surely * abs(true))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    path.write_text(csv_of(made(1, SHADOWING, BURSTS)))
    return path


@pytest.fixture(scope="module")
def fit(written):
    return fit_radio(read_log(written))


def test_radio_fit_recovers_path_loss(fit):
    assert isinstance(fit.path_loss, PathLossFit)
    assert is_found(fit.path_loss.exponent, EXPONENT, 0.05)
    assert is_found(fit.path_loss.rssi_at_1_m_dbm, RSSI_AT_1_M_DBM, 0.02)


def test_radio_fit_recovers_shadowing_and_noise(fit):
    assert isinstance(fit.shadowing, ShadowingFit)
    assert is_found(fit.shadowing.deviation_db, SHADOWING.deviation_db, 0.25)
    assert is_found(fit.shadowing.correlation_m, SHADOWING.correlation_m, 0.5)
    assert is_found(fit.shadowing.noise_db, NOISE_DB, 0.3)


def test_radio_fit_recovers_bursts_from_gaps(fit):
    assert isinstance(fit.losses, LossFit)
    chosen = fit.losses.chosen
    assert chosen.name == "bursts, and single losses between"
    for name, surely in (("bad_s", 0.2), ("good_s", 0.2), ("loss_bad", 0.1), ("loss_good", 0.2)):
        assert is_found((getattr(chosen.bursts, name), chosen.errors[name]), getattr(BURSTS, name), surely)


def test_radio_fit_residuals_are_those_of_the_line(fit):
    rssi_dbm = fit.path_loss.rssi_dbm(fit.distance_m) + fit.residual_db
    assert rssi_dbm == pytest.approx(fit.rssi_dbm)
    assert abs(fit.residual_db.mean()) < 1e-9


def test_radio_fit_table_has_scenario_keys_and_separates_the_antenna(fit):
    table = radio_table(fit, Antenna(power_dbm=3.0, gain_dbi=2.0))["radio"]
    assert table["model"] == "log-distance"
    assert table["antenna"] == {"power_dbm": 3.0, "gain_dbi": 2.0}
    told_dbm = 3.0 + 2 * 2.0 - table["log_distance"]["reference_loss_db"]
    assert told_dbm == pytest.approx(fit.path_loss.rssi_at_1_m_dbm.value, abs=0.01)
    assert Shadowing(**table["shadowing"]).correlation_m == pytest.approx(fit.shadowing.correlation_m.value, rel=1e-3)
    assert Bursts(**table["bursts"]).bad_s == pytest.approx(fit.losses.chosen.bursts.bad_s, rel=1e-3)


def test_radio_fit_rows_have_every_parameter_with_its_error(fit):
    rows: dict[str, FitRow] = {row.parameter: row for row in parameter_rows(fit)}
    assert rows["path loss exponent"].estimate == fit.path_loss.exponent
    assert (rows["shadowing: sigma"].unit, rows["bursts: mean duration"].unit) == ("dB", "s")
    assert not any(row.left_out for row in rows.values())
    assert dict(residual_rows(fit))["root mean square"] == f"{np.sqrt(np.mean(fit.residual_db**2)):.2f} dB"


@pytest.mark.parametrize(
    ("bursts", "name"),
    [(Bursts(0.5, 5.0), "bursts that lose all"), (Bursts(0.5, 5.0, 0.6), "bursts that lose a share")],
)
def test_loss_fit_chooses_the_simplest_sufficient_bursts(bursts, name):
    result = fit_losses(sequences(3, bursts))
    assert isinstance(result, LossFit)
    assert result.chosen.name == name
    for key in result.chosen.errors:
        assert is_found((getattr(result.chosen.bursts, key), result.chosen.errors[key]), getattr(bursts, key), 0.2)


def test_loss_fit_of_thinned_packets_agrees():
    bursts = Bursts(0.5, 5.0, 0.7, 0.02)
    all_packets = sequences(4, bursts, packets=3000)
    thinned = all_packets.thinned(20_000)
    assert len(thinned.lost) == 20_000
    assert thinned.lost.tolist() == all_packets.lost.reshape(20, 3, 1000)[:, 0].ravel().tolist()
    assert np.isinf(thinned.since_s[::1000]).all()
    result = fit_losses(thinned)
    assert isinstance(result, LossFit)
    assert result.chosen.bursts is not None
    assert is_found((result.chosen.bursts.bad_s, result.chosen.errors["bad_s"]), bursts.bad_s, 0.2)


@pytest.mark.parametrize("key", range(4))
def test_loss_fit_recognizes_single_losses(key):
    result = fit_losses(sequences(key, Bursts(1.0, 1.0, 0.1, 0.1)))
    assert isinstance(result, LossFit)
    assert result.chosen.name == "single losses"
    assert is_found(result.loss, 0.1, 0.1)
    assert abs(result.runs_z) < STANDARD_ERRORS


def test_loss_fit_of_links_with_different_shares_has_no_bursts():
    """A chain with one loss for all would have it that links are in bursts for good."""
    many, few = (sequences(5, Bursts(1.0, 1.0, loss, loss)) for loss in (0.4, 0.02))
    apart = int(many.link.max()) + 1
    both = type(many)(
        np.append(many.link, few.link + apart), np.append(many.since_s, few.since_s), np.append(many.lost, few.lost)
    )
    result = fit_losses(both)
    assert isinstance(result, LossFit)
    assert result.chosen.bursts is None
    assert min(result.models, key=lambda model: model.aic).name == "single losses, each link its own share"


def test_radio_fit_of_noise_per_packet_has_no_shadowing(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(csv_of(made(2, Shadowing(1e-9, 5.0), None, packets=6)))
    result = fit_radio(read_log(path))
    assert result.shadowing == "links that are near each other are no more alike than by chance"
    assert is_found(result.path_loss.exponent, EXPONENT, 0.05)
    assert "shadowing" not in radio_table(result, Antenna())["radio"]


def test_radio_fit_of_rows_without_rssi_agrees_with_gaps(tmp_path, fit):
    path = tmp_path / "rows.csv"
    path.write_text(csv_of(made(1, SHADOWING, BURSTS), gaps=False))
    log = read_log(path)
    assert log.rssi_dbm[log.received].tolist() == fit.rssi_dbm.tolist()
    result = fit_losses(loss_sequences(log))
    assert isinstance(result, LossFit)
    assert result.chosen.bursts is not None
    # Times of lost packets are known here, and so are losses at the ends of links.
    assert result.loss.value == pytest.approx(fit.losses.loss.value, rel=0.1)
    assert result.chosen.bursts.bad_s == pytest.approx(fit.losses.chosen.bursts.bad_s, rel=0.2)


def test_radio_fit_of_a_small_log_names_omitted_parts(tmp_path):
    path = tmp_path / "few.csv"
    path.write_text(
        "t_s,tx,rx,seq,rssi_dbm,distance_m\n" + "".join(f"{i},a,b,{i},{-50 - i},{1 + i}\n" for i in range(20))
    )
    result = fit_radio(read_log(path))
    assert isinstance(result.path_loss, PathLossFit)
    assert result.shadowing == "needs positions of sender and receiver, distance_m is not enough"
    assert result.losses == "needs 100 packets, got 20"
    assert sorted(radio_table(result, Antenna())["radio"]) == ["antenna", "log_distance", "model"]


def test_radio_fit_notes_bias_by_missing_weak_packets(tmp_path):
    draws = np.random.default_rng(8)
    rows = ["t_s,tx,rx,seq,rssi_dbm,distance_m"]
    for i in range(6000):
        distance_m = float(np.exp(draws.uniform(0.0, np.log(60.0))))
        rssi_dbm = -50.0 - 27.0 * np.log10(distance_m) + 4.0 * draws.standard_normal()
        if rssi_dbm > -90.0:
            rows.append(f"{i},a-{i % 15},b,{i // 15},{rssi_dbm:.3f},{distance_m:.4f}")
    path = tmp_path / "weak.csv"
    path.write_text("\n".join(rows) + "\n")
    log = read_log(path)
    far, near = fit_radio(log), fit_radio(log.within(12.0))
    assert far.path_loss.exponent.value < 2.6
    assert "exponent, sigma and the RSSI far out are biased" in far.notes[0]
    assert is_found(near.path_loss.exponent, 2.7, 0.05)


def test_link_covariance_matches_the_emulated_field():
    """On the diagonal 1 - delta/d (1 - exp(-d/delta)); beside it the definition's double integral."""
    delta_m = 5.0
    ends_m = np.array([(0.0, 0.0, 10.0, 0.0), (0.0, 5.0, 10.0, 5.0), (5.0, -5.0, 5.0, 5.0), (0.0, 0.0, 2.0, 0.0)])
    share = (np.arange(400) + 0.5)[:, None] / 400
    along = [row[:2] + share * (row[2:] - row[:2]) for row in ends_m]
    length = [float(np.hypot(*(row[2:] - row[:2]))) for row in ends_m]
    exact = [
        [
            np.sqrt(length[i] * length[j])
            * np.exp(-np.hypot(*(p[:, None] - q[None]).transpose(2, 0, 1)) / delta_m).mean()
            / (2.0 * delta_m)
            for j, q in enumerate(along)
        ]
        for i, p in enumerate(along)
    ]
    assert link_covariance(ends_m, delta_m) == pytest.approx(np.array(exact), abs=0.02)


def test_loss_runs_are_geometric_for_bursts_that_lose_all():
    p, r = 0.02, 0.2
    shares = expected_runs(bursts_from_steps(p, r, 1.0, 0.0, 0.1), 0.1, 30)
    assert shares == pytest.approx(r * (1.0 - r) ** np.arange(30))


def test_loss_runs_match_the_emulated_bursts():
    """Their mean, over links, within four standard errors: false alarm 1 in 16 000."""
    bursts = Bursts(0.5, 2.0, 0.7, 0.05)
    t_s = np.repeat(0.1 * np.arange(2000.0)[:, None], 20, axis=1)
    lost = losses(7, bursts, t_s)
    runs = np.count_nonzero(lost[1:] & ~lost[:-1], axis=0)
    means = lost.sum(axis=0) / runs
    expected = float((expected_runs(bursts, 0.1, 200) * np.arange(1, 201)).sum())
    assert abs(means.mean() - expected) < STANDARD_ERRORS * means.std() / np.sqrt(len(means))


@pytest.mark.parametrize(
    ("slope_db", "way"),
    [
        (0.0, "does not fall"),
        (1.0, "does not fall"),
        (-1e-6, "does not fall"),
        (-3.0, "falls too little"),
        (-400.0, "falls too fast"),
    ],
)
def test_path_loss_fit_that_is_implausible_is_omitted(tmp_path, slope_db, way):
    path = tmp_path / "flat.csv"
    rows = [f"{i},a,b,{i},{-50 + slope_db * np.log10(1 + i)},{1 + i}\n" for i in range(20)]
    path.write_text("t_s,tx,rx,seq,rssi_dbm,distance_m\n" + "".join(rows))
    result = fit_radio(read_log(path))
    assert isinstance(result.path_loss, str)
    assert result.path_loss.startswith(f"RSSI {way} with distance: expected an exponent of 0.5 to 20, got ")
    assert result.shadowing == "needs a fit of path loss"
    assert not len(result.residual_db)
    assert radio_table(result, Antenna()) == {"radio": {}}
