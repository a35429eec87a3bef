"""Names and formats of the files of a run folder, the columns of `ticks`, the blocks of the recording, and the log."""

from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.printable import LINES, printable

SUMMARY = "summary.json"  # written last; its presence means that the run is over
RUN_JSON = "run.json"  # provenance of the run, written first
SCENARIO = "scenario.toml"  # the scenario with overrides and seed
STATIC = "static.json"  # constants of the run: arena, bodies and names
RECORDING = "run.rrd"  # recording for the viewer
RECORDING_END = "end"  # last property of a recording; its presence means that the recording was closed
DIGESTS = "trajectory.digests"  # digest of each tick's state, for a repetition
INPUTS = "inputs/actions.frames"  # inputs that do not follow from the seed
LIVE_EVENTS = "live_events.jsonl"  # commands of people during the run
LOG = "log.txt"  # messages, each with its time
DIGEST_BYTES = 8  # bytes per tick in DIGESTS
SUMMARY_FORMAT = 1  # format of summary.json
RUN_FORMAT = 1  # format of run.json
TABLES_FORMAT = 1  # format of the tables, written in static.json

# Columns of the table `ticks`
POSE = ("x_m", "y_m", "heading_rad")  # arena frame
VELOCITY = ("vx_mps", "vy_mps", "turn_radps")  # arena frame
COMMAND = ("command_forward_mps", "command_turn_radps")  # within limits
SIDEWAYS = "command_left_mps"  # within limits; only if a robot can move sideways
HEIGHT = "z_m"  # of the lower side above the floor; only if a source moves robots
MOTION = (*POSE, *VELOCITY, *COMMAND, SIDEWAYS, HEIGHT)  # lists with a number per robot, float32
ROBOT_COLUMNS = (*POSE, *VELOCITY, *COMMAND, "alive", "state")  # lists with an item per robot, in every record
VALUE = "value"  # a list with a number per robot, float64; from the first tick on in which a robot noted a value
MOVABLE = ("movable_x_m", "movable_y_m", "movable_heading_rad")  # lists with a number per movable obstacle, if any
RADIO = ("sent", "received", "in_range")  # packets, receivers and receivers since the previous tick
KEYS = ("tick", "time_s", "arena", "seed")
TICK_COLUMNS = (*KEYS, *ROBOT_COLUMNS, SIDEWAYS, HEIGHT, VALUE, *MOVABLE, *RADIO)  # names that a metric cannot have


@dataclass(frozen=True)
class CopiedFile:
    """A copy of a file that a repetition of the run needs, from the start of the run."""

    path: str  #: relative to the run folder
    sha256: str
    # "scenario" | "agent" | "trace" | "map" | "ground" | "body" | "custom sensor" | "custom actuator" | "metric"
    what: str


FILE_HEADER_BYTES = 12  # magic, version and options of a .rrd
FRAME_HEADER_BYTES = 16  # kind, and the payload's length in the last 8, little-endian


def complete_frames_bytes(path: Path) -> int:
    """Return the size of a .rrd without its last frame if that is cut off, as a killed run may leave it."""
    size, offset = path.stat().st_size, FILE_HEADER_BYTES
    with path.open("rb") as file:
        while offset + FRAME_HEADER_BYTES <= size:
            file.seek(offset + 8)
            end = offset + FRAME_HEADER_BYTES + int.from_bytes(file.read(8), "little")
            if end > size:
                break
            offset = end
    return min(offset, size)


class RunLog:
    """Appends messages to `log.txt`, each with its time; every line is written at once.

    A log that cannot be written never disturbs a run: `lost` counts its messages.
    """

    def __init__(self, folder: Path, clock: WallClock | None = None) -> None:
        """Open the log of an existing run folder; OSError if it cannot be written."""
        self.lost = 0
        self._clock = clock or WallClock()
        self._file = (folder / LOG).open("a", encoding="utf-8", buffering=1)

    def append(self, text: str) -> None:
        """Append a message; lines after the first are indented."""
        first, *more = printable(text, keep=LINES).rstrip("\n").split("\n")
        try:
            self._file.write(
                "\n".join([f"{self._clock.utc_stamp()} {first}", *(f"    {line}" for line in more)]) + "\n"
            )
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Close the file; safe to call more than once."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1
