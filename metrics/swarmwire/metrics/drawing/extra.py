"""The extra [report]: matplotlib, jinja2 for pages and ffmpeg for films, only for those who draw."""

from importlib.util import find_spec

from swarmwire.comms.errors import BadInput


def need_report_extra(wanted_for: str) -> None:
    """Return if matplotlib, imageio-ffmpeg and jinja2 are installed; BadInput tells how to get them."""
    for module, name in (("matplotlib", "matplotlib"), ("imageio_ffmpeg", "imageio-ffmpeg"), ("jinja2", "jinja2")):
        if find_spec(module) is None:
            raise BadInput(wanted_for, "", f"needs {name}: install swarmwire-metrics[report]")
