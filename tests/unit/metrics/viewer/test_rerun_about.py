"""The viewer's text on a run tells of what the selected robot's picture can hold."""

import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.metrics.viewer.about import about
from tests.support.metrics.truths import static


@pytest.mark.parametrize(
    ("body", "rays", "light"), [("epuck", True, True), ("kilobot", False, True), ("point", False, False)]
)
def test_rays_and_light_are_told_of_only_if_the_selected_body_has_them(body, rays, light):
    text = about(static(body=load_body(body)), 0, "flock-1", 1)
    assert "The ring marks flock-1." in text
    assert ("rays" in text, "light" in text) == (rays, light)
