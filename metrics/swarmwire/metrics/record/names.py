"""The files of a run folder, by name."""

SUMMARY = "summary.json"  # written last: where it is, the run is over
RUN_JSON = "run.json"  # from what the run was made, written first
SCENARIO = "scenario.toml"
STATIC = "static.json"
RECORDING = "run.rrd"
DIGESTS = "trajectory.digests"
INPUTS = "inputs/actions.frames"
LOG = "log.txt"

DIGEST_BYTES = 8  # of each tick in DIGESTS
