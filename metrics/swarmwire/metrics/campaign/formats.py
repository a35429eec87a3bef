"""Version and file names of a campaign's folder; another version is refused."""

CAMPAIGN_FORMAT = 1  # of campaign.json and of the tables beside it

ABOUT = "campaign.json"
SUMMARY = "summary.parquet"  # a row per run, once all have ended
PARTS = "parts"  # the same rows before that, in pieces
FAILED = "failed"  # in the column `ended`
SERIES = "series"  # what the metrics were in every tick
