"""The folder of a campaign or a tuning that is about to begin."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER


@contextmanager
def fresh_folder(folder: Path, what: str) -> Generator[Path]:
    """The empty folder for the scenario in it; BadInput unless `folder` is new or empty, and all can be written."""
    scenario_folder = folder / SCENARIO_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise BadInput("--out", str(folder), f"expected a new or empty folder; to go on with a {what}: --resume")
        scenario_folder.mkdir()  # of several that found it empty, the system lets one alone make it
        yield scenario_folder
    except OSError as error:
        raise BadInput("--out", str(folder), f"expected a folder that can be written: {error.strerror}") from error
