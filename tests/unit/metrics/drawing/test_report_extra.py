import sys

import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.body_sheet import draw_body
from swarmwire.metrics.drawing.mp4 import write_mp4


@pytest.mark.parametrize(
    ("module", "name"), [("matplotlib", "matplotlib"), ("imageio_ffmpeg", "imageio-ffmpeg"), ("jinja2", "jinja2")]
)
def test_who_lacks_the_extra_is_told_how_to_get_it(tmp_path, monkeypatch, module, name):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(BadInput) as error:
        draw_body(load_body("epuck"), tmp_path / "a.png", 300)
    assert str(error.value) == f"pictures: needs {name}: install swarmwire-metrics[report]"
    with pytest.raises(BadInput, match="films: needs"):
        write_mp4(tmp_path / "a.mp4", iter(()), 10.0)
    assert not any(tmp_path.iterdir())
