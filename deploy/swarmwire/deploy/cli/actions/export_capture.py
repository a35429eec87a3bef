"""A capture of the frames on air in a run, for Wireshark."""

from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.atomic import check_output_path
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.deploy.cli.exporters import CAPTURE, ExportOptions
from swarmwire.metrics.records.capture import Link, frames_on_air, link_of, write_capture
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.world.scenario_file import load_scenario

MAX_S = 1e9  # longer than any run; in ns it fits 64 bits


def write_frames(run: Path, to: Path, options: ExportOptions) -> str:
    """Write the frames that went on air in an arena from `from_s` to before `until_s`.

    BadInput for a folder without recorded packets, or of a run without a radio.
    """
    check_output_path(to, CAPTURE.suffixes)
    _check_times(options.from_s, options.until_s)
    folder, arena = RunFolder(run), options.arena or 0
    if not 0 <= arena < folder.static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {folder.static.arenas - 1}, got {arena}")
    radio, link = _radio(folder, run)
    packets = folder.validated("packets", arena)
    first_ns = 0 if options.from_s is None else to_ns(options.from_s)
    stop_ns = None if options.until_s is None else to_ns(options.until_s)
    frames = (
        frame
        for frame in frames_on_air(packets, folder.static.robot_names)
        if first_ns <= frame.on_air_at_ns and (stop_ns is None or frame.on_air_at_ns < stop_ns)
    )
    description = f"{folder.static.name}, seed {folder.static.seeds[arena]}: {radio.preset or radio.model}"
    count = write_capture(to, link, f"air-{arena}", description, frames)
    return f"{count} frames{_in_flight(folder, arena)}"


def _in_flight(folder: RunFolder, arena: int) -> str:
    """Return a note on receptions that were under way at the end of the run, which a capture lacks."""
    radio: Any = (folder.summary or {}).get("radio") or {}
    arena_radio = cast("dict[str, Any]", radio[arena] if isinstance(radio, list) else radio)
    count = int(arena_radio.get("fates", {}).get("in_flight", 0))
    return f"; {count} receptions were in flight at the end" if count else ""


def _check_times(from_s: float | None, until_s: float | None) -> None:
    for option, value_s in (("--from", from_s), ("--until", until_s)):
        if value_s is not None and not 0.0 <= value_s <= MAX_S:
            raise BadInput(option, "", f"expected a time of 0 to {MAX_S:g} s, got {value_s:g}")
    if from_s is not None and until_s is not None and not from_s < until_s:
        raise BadInput("--until", "", f"expected a time after --from {from_s:g}, got {until_s:g}")


def _radio(folder: RunFolder, run: Path) -> tuple[Radio, Link]:
    """Return the radio of a run with recorded packets, and its link type in captures."""
    radio = load_scenario(run / SCENARIO).radio
    if radio is None:
        raise BadInput(str(run), "radio", "expected a run with a radio: this one has none")
    if not folder.files("packets"):
        expected = "expected packets, recorded with --packets all; swarmwire repeat RUN --packets all --out … does it"
        raise BadInput(str(run), "packets", expected)
    link = link_of(radio)
    if len(folder.static.robot_names) > link.max_robots:
        raise BadInput(str(run), "robots", f"expected at most {link.max_robots}, which have addresses of their own")
    return radio, link
