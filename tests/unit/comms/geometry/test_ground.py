"""The shade of the floor at a point: patches over a picture over one shade, and the other side of a torus."""

import numpy as np
import pytest

from swarmwire.comms.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.geometry.ground import ground_of, shade_at, shades_over

SIZE_M = (4.0, 2.0)
DISC = Patch("disc", 1.0, 0.0, 0.2, radius_m=0.5)
TRIANGLE = Patch("polygon", 1.0, 0.0, 0.4, points_m=((-0.2, -0.2), (0.2, -0.2), (0.0, 0.3)))
GREY = np.array([[0, 51, 102, 153], [255, 204, 153, 102]], np.uint8)  # each a square metre


def test_without_a_floor_all_is_white():
    assert shade_at(ground_of(None, SIZE_M, "walls"), 0.3, 0.4) == 1.0


def test_the_last_patch_wins_and_its_rim_belongs_to_it():
    ground = ground_of(Floor(0.9, (DISC, TRIANGLE)), SIZE_M, "walls")
    at = {(1.0, 0.0): 0.4, (1.0, 0.3): 0.4, (1.2, -0.2): 0.4, (1.15, 0.2): 0.2, (1.5, 0.0): 0.2, (1.6, 0.0): 0.9}
    assert {point: shade_at(ground, *point) for point in at} == at
    assert shade_at(ground_of(Floor(0.9, (TRIANGLE, DISC)), SIZE_M, "walls"), 1.0, 0.0) == 0.2


def test_a_picture_is_stretched_over_the_arena_top_row_at_the_greatest_y():
    ground = ground_of(Floor(0.5, (), packed_image(GREY)), SIZE_M, "walls")
    x, y = np.arange(-1.5, 2.0), (0.5, -0.5)
    assert [[shade_at(ground, at, up) for at in x] for up in y] == pytest.approx(GREY / 255.0)
    assert shades_over(ground, x, np.array(y)) == pytest.approx(GREY / 255.0)
    corners = [shade_at(ground, at, up) for at, up in ((-2.0, 1.0), (2.0, 1.0), (-2.0, -1.0), (2.0, -1.0))]
    assert corners == pytest.approx([0.0, 0.6, 1.0, 0.4])
    assert [shade_at(ground, 2.01, 0.0), shade_at(ground, 0.0, -1.01)] == [0.5, 0.5]
    assert shade_at(ground_of(Floor(0.5, (DISC,), packed_image(GREY)), SIZE_M, "walls"), 1.1, 0.1) == 0.2


def test_on_a_torus_patch_and_picture_go_on_at_the_other_side():
    disc = Patch("disc", 1.9, 0.9, 0.2, radius_m=0.3)
    wrapped, cut = (ground_of(Floor(1.0, (disc,)), SIZE_M, boundary) for boundary in ("torus", "open"))
    for x, y in ((-1.9, 0.9), (1.9, -0.9), (-1.95, -0.95), (2.05, 1.05)):
        assert shade_at(wrapped, x, y) == 0.2
    assert [shade_at(cut, -1.9, 0.9), shade_at(cut, 2.05, 1.05)] == [1.0, 0.2]
    picture = ground_of(Floor(1.0, (), packed_image(GREY)), SIZE_M, "torus")
    for x, y in ((-1.5, 0.5), (0.5, -0.5)):
        assert {shade_at(picture, x + 4.0 * i, y + 2.0 * j) for i in (-1, 0, 1) for j in (-1, 0, 1)} == {
            shade_at(picture, x, y)
        }
