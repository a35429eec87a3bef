"""The files of a run folder, by name."""

SUMMARY = "summary.json"  # written last: where it is, the run is over
RUN_JSON = "run.json"  # from what the run was made, written first
SCENARIO = "scenario.toml"  # as run, with overrides and seed
STATIC = "static.json"  # arena, bodies and names: what does not change
RECORDING = "run.rrd"  # for the viewer
DIGESTS = "trajectory.digests"  # of each tick's state, for a repetition
INPUTS = "inputs/actions.frames"  # what came from outside
LIVE_EVENTS = "live_events.jsonl"  # what people did to it while it went on
LOG = "log.txt"  # what people were told

DIGEST_BYTES = 8  # of each tick in DIGESTS
