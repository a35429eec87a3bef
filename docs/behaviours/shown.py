"""What is shown of each behaviour: a picture with trails and metrics, and the response that loss and latency spoil."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from docs.experiments.experiment import ROOT, Layout
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput

PACKETS, RAYS, INFRARED, SCANS = "packets", "rays' readings", "infrared rays' readings", "scanner's readings"
BEFORE_WALLS = "oscillation", "deadlocked"  # how robots fare that something holds up
CONTACTS = "contacts between robots per robot-hour"
TIME_LABEL = "time until half of them are at the light, s"
SCENARIOS = ROOT / "scenarios" / "behaviours"
LAYOUT = Layout(
    figures=ROOT / "docs" / "behaviours",
    campaigns=SCENARIOS / "campaigns",
    swept=ROOT / "campaigns" / "behaviours",
    data=ROOT / "docs" / "behaviours" / "data",
    pages=ROOT / "docs" / "behaviours",
    figure_ending="-degradation.svg",
)
SIZE_PX = 960
COLORS = 128


@dataclass(frozen=True)
class Shown:
    """Of one behaviour."""

    title: str  # the response, in words, with its unit
    response: str  # its column in the campaign's summary
    metrics: tuple[str, ...]  # beside the picture
    trail_s: float = 60.0  # how much of the robots' ways is drawn
    at_s: float | None = None  # when the picture is taken; None: at the end
    lost: str = PACKETS  # what is lost and late


SHOWN = {
    "aggregation": Shown(
        "share of the robots in the largest cluster, at the end", "aggregation.final", ("aggregation",)
    ),
    "avoidance": Shown(CONTACTS, "collision_rate.final", ("collisions", "min_gap"), 20.0, lost=RAYS),
    "beacon_avoidance": Shown(CONTACTS, "collision_rate.final", ("collisions", "min_gap"), 8.0),
    "consensus": Shown(
        "time until the values are within 0.01 of their mean, s", "stop_time_s", ("consensus_error", "consensus_bias")
    ),
    "coverage": Shown("share of the floor that was covered, at the end", "coverage.final", ("coverage",)),
    "diffusion": Shown(CONTACTS, "collision_rate.final", ("nearest_neighbour", "collisions"), lost=RAYS),
    "flocking": Shown("order of headings, mean over the time of a run", "order.mean", ("order",)),
    "lennard_jones_flocking": Shown(
        "distance to the nearest other robot, m, at the end", "nearest_neighbour.final", ("target_mean",)
    ),
    "minimalist_flocking": Shown(
        "share of the robots in the largest cluster, at the end",
        "aggregation.final",
        ("aggregation", "aggregation_hop"),
        lost=INFRARED,
    ),
    "pso_model": Shown(TIME_LABEL, "find_time_s", ("target_best", "target_mean")),
    "pso_search": Shown(TIME_LABEL, "find_time_s", ("target_best", "target_mean")),
    "pso_search_positioned": Shown(TIME_LABEL, "find_time_s", ("target_best", "target_mean")),
    "random_walk": Shown("share of the floor that was covered, at the end", "coverage.final", ("coverage",), lost=RAYS),
    "smoothed_avoidance": Shown(CONTACTS, "collision_rate.final", BEFORE_WALLS, 30.0, lost=SCANS),
    "smoothed_avoidance_proximity": Shown(CONTACTS, "collision_rate.final", BEFORE_WALLS, 30.0, lost=RAYS),
    "threshold_rule": Shown(CONTACTS, "collision_rate.final", BEFORE_WALLS, 30.0, lost=SCANS),
    "threshold_rule_proximity": Shown(CONTACTS, "collision_rate.final", BEFORE_WALLS, 30.0, lost=RAYS),
    "vicsek": Shown("order of headings, mean over the time of a run", "order.mean", ("order",), 10.0),
}


PAGES = {  # NAME.md: behaviours described there, in their order
    "avoiding": (
        "avoidance",
        "beacon_avoidance",
        "smoothed_avoidance",
        "smoothed_avoidance_proximity",
        "threshold_rule",
        "threshold_rule_proximity",
    ),
    "moving_together": ("flocking", "vicsek", "lennard_jones_flocking", "minimalist_flocking"),
    "searching": ("pso_search", "pso_search_positioned", "pso_model"),
    "spreading_and_gathering": ("random_walk", "diffusion", "coverage", "aggregation", "consensus"),
}


def page_of(name: str) -> str:
    """Page that describes the behaviour, without its suffix."""
    return next(page for page, members in PAGES.items() if name in members)


def find_shown(name: str, layout: Layout) -> Shown:
    """What is shown of a behaviour; BadInput names those that there are, or says that it has no campaign."""
    if name not in SHOWN:
        raise BadInput("NAME", name, f"unknown behaviour; expected {did_you_mean(SHOWN, name)}")
    campaign = layout.campaigns / f"{name}.toml"
    if not campaign.exists():
        raise BadInput(str(campaign), "", "is missing: expected the campaign of a behaviour")
    return SHOWN[name]


def names(layout: Layout) -> tuple[str, ...]:
    """Of all behaviours that have a campaign, in the order of the alphabet."""
    return tuple(sorted(file.stem for file in layout.campaigns.glob("*.toml")))


def draw_picture(name: str, layout: Layout) -> Path:
    """Run the behaviour's scenario and draw it into NAME.png; where that is."""
    from PIL import Image

    from swarmwire.deploy import Recording, run
    from swarmwire.metrics.pictures.drawing.animation import FilmFigure
    from swarmwire.metrics.pictures.drawing.film import film_of
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    shown, to = find_shown(name, layout), layout.pages / f"{name}.png"
    with TemporaryDirectory() as folder:
        run(SCENARIOS / f"{name}.toml", out=folder, record=Recording(rrd=False))
        film = film_of(RunFolder(Path(folder)), 0, name)
        figure = FilmFigure(film, SIZE_PX, [*shown.metrics], shown.trail_s)
        at = len(film.time_s) - 1 if shown.at_s is None else film.index_at(shown.at_s)
        picture = Path(folder) / to.name
        figure.save(at, picture)
        Image.open(picture).convert("RGB").quantize(COLORS).save(to, optimize=True)
    return to
