"""What of a run goes into its folder, beside the summary."""

from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.messages import DICT_TAG, Message
from swarmwire.comms.protocols import Observer
from swarmwire.comms.truth import Static
from swarmwire.deploy.live.published import Published
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.recorders import recorders
from swarmwire.metrics.rerun_recording import RerunRecording
from swarmwire.metrics.rerun_selected import selected_robot


@dataclass(frozen=True)
class Recording:
    """What to record. A run can be repeated (`swarmwire repeat`), with more recorded than the first time."""

    packets: float = 0.0  # share of the packets that go into `packets.parquet`, drawn by key; 1: all
    tables: bool = True  # `ticks.parquet`, `events.parquet`
    rrd: bool = True  # `run.rrd`, for rerun's viewer
    select: str | None = None  # the robot that views show in detail; None: the first that has rays or photocells

    def __post_init__(self) -> None:
        if not 0.0 <= self.packets <= 1.0:
            raise BadInput("--packets", "", f'expected "off", "all" or a share from 0 to 1, got {self.packets!r}')
        if self.packets and not self.tables:
            raise BadInput("--packets", "", "expected no packets without tables")

    def check(self, static: Static) -> None:
        """BadInput unless the selected robot is one of the run's."""
        selected_robot(static, self.select, "--select")

    def observers(self, folder: Path, run_id: str, metrics: Metrics, clock: Clock, may_drop: bool) -> list[Observer]:
        """Those that fill the folder, and let others look on; `metrics` must see each tick before them."""
        found: list[Observer] = []
        if self.tables:
            found += recorders(folder, metrics, clock, packets=self.packets, topics=_topics(Message), may_drop=may_drop)
        if self.rrd:
            found.append(RerunRecording(folder / "run.rrd", metrics, selected=self.select))
        return [*found, Published(folder, run_id, metrics, clock, selected=self.select)]


def packet_share(text: str) -> float:
    """The share of packets that "off", "all" or a number asks for; BadInput for anything else."""
    try:
        return {"off": 0.0, "all": 1.0}[text] if text in ("off", "all") else float(text)
    except ValueError:
        raise BadInput("--packets", "", f'expected "off", "all" or a share from 0 to 1, got {text!r}') from None


def _topics(kind: type[Message]) -> dict[int, str]:
    """The names of all messages that agents known to this process have defined, by tag."""
    names = {DICT_TAG: "dict"}
    for below in kind.__subclasses__():
        names |= {below.tag: below.__name__, **_topics(below)}
    return names
