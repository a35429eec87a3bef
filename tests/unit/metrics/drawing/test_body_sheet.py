import numpy as np
import pytest

from swarmwire.comms.bodies.body import body_from, body_names, load_body
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.body_facts import facts_of
from swarmwire.metrics.drawing.body_sheet import draw_body
from swarmwire.metrics.drawing.view_from_above import draw_from_above

pytest.importorskip("matplotlib", reason="needs the extra [report]")


@pytest.mark.parametrize("name", body_names())
def test_every_body_that_comes_along_can_be_drawn(tmp_path, name):
    from PIL import Image

    draw_body(load_body(name), tmp_path / "a.png", 400)
    with Image.open(tmp_path / "a.png") as image:
        assert max(image.size) == 400
        assert len(np.unique(np.asarray(image).reshape(-1, 4), axis=0)) > 50


def test_a_body_without_any_sense_can_be_drawn(tmp_path):
    drive = {"wheel_base_m": 0.1, "max_wheel_mps": 0.2, "max_force_n": 1.0, "max_torque_nm": 1.0}
    sheet = {"name": "bare", "source": "a test", "radius_m": 0.1, "height_m": 0.1, "mass_kg": 1.0, "drive": drive}
    draw_body(body_from(sheet, "bare.toml"), tmp_path / "a.svg", 400)
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")


def test_rays_start_at_the_rim_and_end_at_their_range_with_the_front_up():
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    body, axes = load_body("epuck"), Figure().add_axes((0, 0, 1, 1))
    draw_from_above(axes, body)
    [rays] = [artist for artist in axes.collections if isinstance(artist, LineCollection)]
    ends = np.array([path.vertices for path in rays.get_paths()])  # (rays, 2, 2)
    assert body.proximity
    distance_m = np.linalg.norm(ends, axis=2)
    np.testing.assert_allclose(distance_m, [[body.radius_m, body.radius_m + body.proximity.range_m]] * len(ends))
    ahead_deg = np.degrees(np.arctan2(-ends[:, 1, 0], ends[:, 1, 1])) % 360  # counter-clockwise from up
    np.testing.assert_allclose(ahead_deg, body.proximity.angles_deg)


@pytest.mark.parametrize(("range_m", "faint"), [(0.12, 1.0), (2.0, 0.1)])
def test_rays_of_a_scan_fade_only_where_they_leave_the_view_and_the_legend_tells_their_range(range_m, faint):
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    senses = {"scan": {"rays": 1, "range_m": range_m}}
    axes = Figure().add_axes((0, 0, 1, 1))
    draw_from_above(axes, body_from({"like": "epuck", "name": "a", "senses": senses}, "a.toml"))
    drawn = [artist for artist in axes.collections if isinstance(artist, LineCollection)][1:]
    assert min(part.get_alpha() for part in drawn) == pytest.approx(faint)
    legend = axes.get_legend()
    assert legend
    assert f"range finder, to {range_m:g} m" in [text.get_text() for text in legend.get_texts()]


def test_the_facts_are_those_of_the_data_sheet():
    facts = dict(facts_of(load_body("epuck")))
    assert facts["size"] == "7 cm across, 8.6 cm high"
    assert facts["wheels"] == "5.3 cm apart"
    assert facts["proximity"] == "8 rays of 10 cm"
    assert facts["odometry"] == "slip 5 %, step 0.13 mm"
    assert "positioning" not in facts
    assert dict(facts_of(load_body("epuck-gps")))["positioning"] == "error 1 cm"


def test_each_fact_has_a_name_of_its_own():
    for name in body_names():
        names = [fact for fact, _ in facts_of(load_body(name)) if fact]
        assert len(names) == len(set(names)), name
    assert dict(facts_of(load_body("footbot")))["LEDs"] == "13, the last a beacon"


def test_own_senses_and_actuators_are_facts_by_their_class():
    sheet = {"like": "epuck", "name": "sealer", "actuators": {"sealer": {"kind": "gas.py:Sealer"}}}
    sheet["senses"] = {"gas": {"kind": "gas.py:Sniffer"}}
    facts = dict(facts_of(body_from(sheet, "sealer.toml")))
    assert (facts["gas"], facts["sealer"]) == ("by gas.py:Sniffer", "by gas.py:Sealer")


def test_only_a_body_that_flies_is_told_to():
    flying = body_from({"like": "epuck", "name": "flying", "altitude_m": 1.0}, "flying.toml")
    assert dict(facts_of(flying))["flies"] == "1 m up"
    assert "flies" not in dict(facts_of(load_body("epuck")))


def test_a_size_that_nobody_could_look_at_is_refused(tmp_path):
    with pytest.raises(BadInput, match="--size: expected 100 to 8000 pixels, got 9000"):
        draw_body(load_body("epuck"), tmp_path / "a.png", 9000)
