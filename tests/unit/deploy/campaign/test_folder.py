"""The folder of a campaign or a tuning, before its first run."""

from contextlib import suppress
from pathlib import Path

import pytest

from swarmwire.deploy.campaigns.folder import new_folder
from tests.support.refusals import refused_input


def test_campaign_folder_is_empty_again_after_an_interrupted_start(tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt), new_folder(tmp_path / "out", "campaign") as scenario_folder:
        (scenario_folder / "scenario.toml").touch()
        raise KeyboardInterrupt
    with new_folder(tmp_path / "out", "campaign") as scenario_folder:
        assert not [*scenario_folder.iterdir()]


@pytest.mark.parametrize(("file", "advice"), [("campaign.json", "to continue"), ("scenario", "remove")])
def test_campaign_folder_that_is_not_empty_is_refused_with_its_next_step(
    file: str, advice: str, tmp_path: Path
) -> None:
    (tmp_path / file).mkdir()
    with refused_input(key=str(tmp_path), match=advice), new_folder(tmp_path, "campaign"):
        pass
