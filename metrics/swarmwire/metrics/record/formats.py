"""Versions of what stands in a run folder: another one is refused. Something that is added keeps the version."""

SUMMARY_FORMAT = 1  # of summary.json
RUN_FORMAT = 1  # of run.json
TABLES_FORMAT = 1  # of static.json, which has it, and of the tables
