"""The extra [ui]: the page needs a web server, and only those who open it install one."""

from importlib.util import find_spec

from swarmwire.comms.errors import BadInput

NEEDED = ("fastapi", "uvicorn")


def need_ui_extra(wanted_for: str) -> None:
    """Return if the page can be served here; BadInput tells how to get what it lacks."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise BadInput(wanted_for, "", f'needs {" and ".join(missing)}: pip install "swarmwire[ui]"')
