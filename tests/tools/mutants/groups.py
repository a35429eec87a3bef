"""What is mutated, and by which tests each module is tried: those that are near it, the quick ones first."""

COMMS = "swarmwire.comms."  # before the names of all modules here
LEAST_KILLED = 0.85  # of each group

Tests = tuple[str, ...]


def _in(folder: str, *names: str) -> Tests:
    return tuple(f"{folder}/test_{name}.py" for name in names)


def _but(path: str, test: str) -> str:
    """Without one of the tests of the air."""
    return f"--deselect=tests/unit/comms/air/{path}::test_{test}"


def _wire(*names: str) -> Tests:
    return _in("tests/unit/comms/wire", *names)


TICKS = _wire("tick_frames", "frames")
TRUTHS = _wire("truth_frames")

CODEC: dict[str, Tests] = {
    "wire.frames": _wire("frames", "tick_frames"),
    "wire.unpacking": _wire("unpacking", "frames"),
    "wire.checked": TICKS,
    "wire.tick_frames": (*TICKS, *_wire("in_time_frames")),
    "wire.truth_frames": TRUTHS,
    "wire.memory_frames": ("tests/unit/agent/test_memory.py",),
    "wire.air_frames": _wire("air_frames"),
    "wire.in_time_frames": _wire("in_time_frames"),
    "wire.control_frames": _wire("control_frames"),
    "wire.scene_frames": TRUTHS,
    "wire.offer": _wire("offer"),
    "wire.join_request": _wire("join_request", "offer"),
    "wire.poses": _wire("poses"),
}
DRAWS: dict[str, Tests] = {
    "draws": ("tests/unit/comms/test_draws.py",),
    "draws_compiled": ("tests/unit/comms/test_draws.py",),
}
DISK = (
    *_in("tests/unit/comms/air/disk", "senders", "queue", "backlog"),
    *_in("tests/unit/comms/air", "disruption", "times", "accounts", "layouts"),
    *_in("tests/unit/comms/events", "fail", "blackout", "partition"),
)
REACH = (
    *_in("tests/unit/comms/air/disk", "reach", "torus"),
    *_in("tests/unit/comms/air/stages", "loss", "trace", "bodies_block", "chain"),
    *_in("tests/unit/comms/air", "tune", "news"),
    "tests/unit/comms/air/probe/test_coverage.py::test_the_radio_graph_has_the_pairs_with_enough_delivery",
    *DISK,
)
TOLD = (
    *_in("tests/unit/comms/air", "news", "departed", "kept_order", "within_ticks"),
    "tests/unit/comms/air/signal/test_keyed_fates.py",
    *DISK,
)
# Without those that hypothesis leads through hundreds of runs, or that count on single precision: the compiler is off.
SIGNAL = (
    *_in("tests/unit/comms/air/signal", "keyed_fates", "outcomes"),
    _but("signal/test_outcomes.py", "each_addressed_packet_has_one_outcome_unless_it_is_in_flight"),
)
RECEIVED = (
    *SIGNAL,
    *_in("tests/unit/comms/air/signal", "signal_reception", "jamming", "trace_of_signals"),
    _but("signal/test_signal_reception.py", "throughput_of_aloha_is_that_of_abramson"),
    _but("signal/test_signal_reception.py", "strength_is_equal_both_ways_to_the_last_bit"),
    _but("signal/test_trace_of_signals.py", "fates_add_up_and_arenas_do_not_meet"),
)
REPORTED = (
    *_in("tests/unit/comms/air/signal", "reports"),
    *SIGNAL,
    *_in("tests/unit/comms/air", "departed", "times"),
    "tests/unit/comms/air/signal/test_trace_of_signals.py::test_a_delay_comes_after_reception",
    *_in("tests/unit/comms/air/signal", "retries", "signal_accounts"),
    _but("signal/test_signal_accounts.py", "fates_add_up_to_intended_receivers"),
    _but("signal/test_signal_accounts.py", "fates_add_up_when_robots_die_and_are_revived"),
    _but("signal/test_signal_accounts.py", "tally_agrees_with_what_is_listed"),
)
FATES: dict[str, Tests] = {
    "fates": _in("tests/comms", "fates"),
    **{f"air.disk.{name}": DISK for name in ("queue", "backlog", "senders")},
    **{f"air.disk.{name}": REACH for name in ("disk_way", "channel")},
    **{f"air.{name}": DISK for name in ("intake", "links", "transmissions", "accounts")},
    "air.news": TOLD,
    "air.lives": (*_in("tests/unit/comms/air", "lives"), *DISK),
    **{f"air.stages.{name}": REACH for name in ("fixed_loss", "disrupted", "line_of_sight")},
    "air.signal.send_results": SIGNAL,
    **{f"air.signal.{name}": REPORTED for name in ("reports", "attempts")},
    **{f"air.signal.{name}": RECEIVED for name in ("frame_fate", "losses")},
}
GROUPS = {"codec": CODEC, "draws": DRAWS, "fates": FATES}
