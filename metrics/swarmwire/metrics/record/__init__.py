"""What a run leaves in its folder: tables in Parquet, what does not change in JSON, and a log."""
