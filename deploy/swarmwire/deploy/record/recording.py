"""What of a run goes into its folder, beside the summary."""

from dataclasses import dataclass

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Static
from swarmwire.metrics.viewer.selection import selected_robot


@dataclass(frozen=True)
class Recording:
    """What to record. A run can be repeated (`swarmwire repeat`), with more recorded than the first time."""

    packets: float = 0.0  # share of the packets that go into `packets.parquet`, drawn by key; 1: all
    links: bool = False  # `radio_links.parquet`
    tables: bool = True  # `ticks.parquet`, `events.parquet`, `radio_robots.parquet`, `radio_distances.parquet`
    rrd: bool = True  # `run.rrd`, for rerun's viewer
    select: str | None = None  # the robot that views show in detail; None: the first that has rays or photocells

    def __post_init__(self) -> None:
        if not 0.0 <= self.packets <= 1.0:
            raise BadInput("--packets", "", f'expected "off", "all" or a share from 0 to 1, got {self.packets!r}')
        if self.packets and not self.tables:
            raise BadInput("--packets", "", "expected no packets without tables")
        if self.links and not self.tables:
            raise BadInput("--links", "", "expected no links without tables")

    def check(self, static: Static) -> None:
        """BadInput unless the selected robot is one of the run's."""
        selected_robot(static, self.select, "--select")


def packet_share(text: str) -> float:
    """The share of packets that "off", "all" or a number asks for; BadInput for anything else."""
    try:
        return {"off": 0.0, "all": 1.0}[text] if text in ("off", "all") else float(text)
    except ValueError:
        raise BadInput("--packets", "", f'expected "off", "all" or a share from 0 to 1, got {text!r}') from None
