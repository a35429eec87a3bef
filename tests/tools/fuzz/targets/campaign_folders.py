"""Folders of campaigns: what was asked for, a row for each run, and what is computed of them."""

from pathlib import Path

from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from tests.support.metrics.campaign.campaigns import write_campaign
from tests.tools.fuzz.folder_target import FolderTarget


class CampaignFolders(FolderTarget):
    """What a campaign left."""

    name = "campaign-folder"
    quick = 150

    def make(self, folder: Path) -> None:
        """A campaign over two parameters, as tests write it."""
        write_campaign(folder)

    def read(self, folder: Path, *, deep: bool) -> str | None:
        """Every sample of every outcome."""
        of = CampaignFolder(folder)
        for outcome in of.outcomes:
            for point in range(len(of.points)):
                of.sample(outcome.column, point)
        return None if of.finished else "unfinished"
