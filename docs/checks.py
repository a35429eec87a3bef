"""Checks that the pages say what the code and the data say: `python -m docs.checks`, or `make docs-check`.

Each check yields a line for each problem. They need no site and run no simulation; a figure that a command draws is
not compared, and `make pictures` draws it again.
"""

import csv
import re
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.targets import TARGETS
from docs.behaviours import shown as of_behaviours
from docs.behaviours.degradation import LATENCY, LOSS, degradation_of
from docs.behaviours.shown import PAGES as PAGES_OF_BEHAVIOURS
from docs.behaviours.shown import SHOWN, page_of
from docs.experiments.experiment import LAYOUT, Experiment, Layout, find_experiment
from docs.experiments.experiment import names as experiments
from docs.experiments.making import digests, page_files
from docs.field_checks import field_comments
from docs.pictures.radio.__main__ import FIGURES
from docs.prose_checks import prose
from docs.protocol_checks import protocol_page
from docs.reference import filled
from swarmwire.agent import behaviours
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.comms.protocols.epuck2.packets import COMMAND_BYTES, SENSORS
from swarmwire.comms.robot.bodies.body import body_from
from swarmwire.deploy.campaigns.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.robots.fleet_file import FleetTable, RobotTable
from tests.docs.pages import PAGES, blocks_of, files_of

ROOT = Path(__file__).parents[1]
MAX_BYTES = 150_000  # of a picture
Problems = Iterator[str]


def links() -> Problems:
    """Links between files lead to files."""
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)[^):]*\)", _text(page)):
            if not ((ROOT / page).parent / target).exists():
                yield f"{page}: links to {target}, which does not exist"


def contents() -> Problems:
    """The landing page lists every page once; pages of behaviours and experiments are listed on their own."""
    blocks = re.findall(r"^```\{toctree\}\n(.*?)^```", _text("docs/index.md"), re.DOTALL | re.MULTILINE)
    listed = [line for block in blocks for line in block.splitlines() if line and not line.startswith(":")]
    yield from (f"docs/index.md: lists {name} more than once" for name in sorted(set(listed)) if listed.count(name) > 1)
    pages = {page.removeprefix("docs/").removesuffix(".md") for page in PAGES if page.startswith("docs/")}
    below = {page for page in pages if page.startswith(("behaviours/", "experiments/"))} - {"experiments/index"}
    yield from (f"docs/index.md: does not list {name}" for name in sorted(pages - below - {"index"} - set(listed)))


def code_blocks() -> Problems:
    """Tables are TOML, bodies are bodies, and every program is in a file that the page names and a command uses."""
    for page in PAGES:
        for block in blocks_of(page, "toml"):
            try:
                table = tomllib.loads(block.text)
                if page == "docs/bodies.md":
                    body_from(table, page)
            except (tomllib.TOMLDecodeError, SwarmwireError) as error:
                yield f"{page}: {error}"
        if not page.startswith("docs"):
            continue
        files = files_of(page)
        if not all(block.file for block in blocks_of(page, "python")):
            yield f"{page}: a block of Python has no file name above it"
        for name in files:
            users = [block.text for block in blocks_of(page, "console")] + [files[k] for k in files if k != name]
            if not any(name in user for user in users) or f"`{name}`" not in _text(page):
                yield f"{page}: {name} is shown, but the text does not name it, or nothing uses it"


def behaviour_pages() -> Problems:
    """Each behaviour has a section with its pictures, a scenario, a campaign and data of the whole campaign."""
    layout = of_behaviours.LAYOUT
    classes = {re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower(): name for name in behaviours.__all__}
    described = [name for names in PAGES_OF_BEHAVIOURS.values() for name in names]
    data = [file.stem for file in layout.data.iterdir()]
    if any(sorted(names) != sorted(classes) for names in (described, data, of_behaviours.names(layout), SHOWN)):
        yield f"docs/behaviours: expected sections, campaigns, data and lines in shown.py for {sorted(classes)}"
        return
    for name, kind in classes.items():
        page = f"docs/behaviours/{page_of(name)}.md"
        text = _text(page).partition(f"\n## {kind}\n")[2].partition("\n## ")[0]
        pictures = [f"{name}.png", f"{name}-degradation.svg"]
        named = (f"<!-- reference: behaviour {kind} -->\n", f"swarmwire run scenarios/behaviours/{name}.toml\n")
        if re.findall(r"^!\[.+\]\((.+)\)$", text, re.MULTILINE) != pictures or not all(part in text for part in named):
            yield f"{page}: expected {', '.join(pictures)} and {' and '.join(map(str.strip, named))}"
        groups = tomllib.loads(_text(f"scenarios/behaviours/{name}.toml"))["robots"].values()
        if {group["agent"] for group in groups} != {f"swarmwire.agent.behaviours:{kind}"}:
            yield f"scenarios/behaviours/{name}.toml: has other agents than {kind}"
        yield from _figure(degradation_of(name, layout), layout, f"python -m docs.behaviours draw {name}")
        yield from _whole_campaign(name, layout)


def _whole_campaign(name: str, layout: Layout) -> Problems:
    file = layout.campaigns / f"{name}.toml"
    campaign = campaign_file(file)
    if campaign is None:
        yield f"{file}: is a scenario, not a campaign"
        return
    plan = plan_of(spec_in(file, campaign))
    [data] = digests(degradation_of(name, layout), layout).values()
    levels = [plan.vary()[path] for path in plan.vary()]
    same = [sorted(data[LOSS].unique()), sorted(data[LATENCY].unique())] == levels
    if not same or set(data["seed"]) != set(plan.spec.seeds) or len(data) != len(plan.points) * len(plan.spec.seeds):
        yield f"{layout.data / name}.parquet: is not of the whole campaign {file.name}"


def experiment_pages() -> Problems:
    """Each experiment has campaigns, data and a figure, and the numbers on its page are those of its data."""
    for name in experiments(LAYOUT):
        experiment = find_experiment(name, LAYOUT)
        if missing := [
            campaign for campaign in experiment.campaigns if not (LAYOUT.campaigns / f"{campaign}.toml").exists()
        ]:
            yield f"scenarios/papers: lacks the campaigns {missing} of {name}"
        if f"({name}.svg)" not in _text(f"docs/experiments/{experiment.page}.md"):
            yield f"docs/experiments/{experiment.page}.md: does not show {name}.svg"
        yield from _experiment(experiment, LAYOUT, f"python -m docs.experiments draw {name}")


def _experiment(experiment: Experiment, layout: Layout, draw: str) -> Problems:
    page = layout.pages / f"{experiment.page}.md"
    files = page_files(page, experiment.name, experiment.numbers(digests(experiment, layout)))
    if any(not file.exists() or file.read_text(encoding="utf-8") != text for file, text in files.items()):
        yield f"{page.relative_to(ROOT)}: its numbers are not those of its data: {draw}"
    yield from _figure(experiment, layout, draw)


def _figure(experiment: Experiment, layout: Layout, draw: str) -> Problems:
    figure = layout.figure_of(experiment.name)
    if not figure.exists() or b"<svg" not in figure.read_bytes()[:1000]:
        yield f"{figure.relative_to(ROOT)}: no figure: {draw}"


def pictures() -> Problems:
    """The pages about the radio show each of their figures once; pictures are small enough to be kept with the code."""
    text = _text("docs/radio.md") + _text("docs/radio-presets.md")
    shown = re.findall(r"^!\[.+\]\(radio/(.+)\.svg\)$", text, re.MULTILINE)
    if not sorted(shown) == sorted(FIGURES) == sorted(path.stem for path in (ROOT / "docs" / "radio").iterdir()):
        yield f"docs/radio*.md: expected each figure once: {sorted(FIGURES)}"
    for path in (file for folder in ("radio", "behaviours") for file in (ROOT / "docs" / folder).iterdir()):
        if path.suffix in {".svg", ".png"} and path.stat().st_size > MAX_BYTES:
            yield f"{path.relative_to(ROOT)}: expected at most {MAX_BYTES} bytes"


def generated_tables() -> Problems:
    """The tables that `docs.reference` writes are those of the code."""
    for page in PAGES:
        text = _text(page)
        if filled(text, page) != text:
            yield f"{page}: its generated tables are out of date: python -m docs.reference"


def benchmark_rows() -> Problems:
    """The table of the page about performance has a measured row for every target."""
    rows = csv.DictReader(_text("docs/dev/performance.csv").splitlines())
    measured = {row["name"] for row in rows if row["verdict"] in ("met", "missed")}
    missing = sorted(TARGETS.keys() - measured)
    yield from (f"docs/dev/performance.csv: has no measured row for {name}" for name in missing)


def fleet_keys() -> Problems:
    """The page about fleets has a row for every key of `fleet.toml`."""
    rows = [line.split("|")[1] for line in _text("docs/fleet.md").splitlines() if line.startswith("| `")]
    documented = {name for row in rows for name in row.split("`")[1::2]}
    yield from (
        f"docs/fleet.md: has no row for {key}"
        for key in sorted({*FleetTable.__struct_fields__, *RobotTable.__struct_fields__} - documented)
    )


def robot_bytes() -> Problems:
    """The tables of the bytes that an e-puck2 takes and gives add up to the packets."""
    rows = re.compile(r"^\| (\d+)(?:-(\d+))? \| (?:(\d+) )?([iuf]\d) \|", re.MULTILINE)
    documented: list[tuple[str, int]] = []
    for text, size in zip(_text("docs/epuck2.md").split("## Answer"), (COMMAND_BYTES, SENSORS.itemsize), strict=True):
        position = 0
        documented = [(kind, int(count or 1)) for _, _, count, kind in rows.findall(text)]
        for (first, last, _, _), (kind, count) in zip(rows.findall(text), documented, strict=True):
            if int(first) != position or int(last or first) + 1 != position + count * int(kind[1]):
                yield f"docs/epuck2.md: expected the row of {kind} at byte {first} to begin at {position}"
            position = int(last or first) + 1
        if position != size:
            yield f"docs/epuck2.md: expected {size} bytes in a table, got {position}"
    ours = [(SENSORS[name].base.str[1:], *(SENSORS[name].shape or (1,))) for name in SENSORS.names or ()]
    if documented != ours:
        yield f"docs/epuck2.md: expected the answer's fields {ours}"


CHECKS: tuple[Callable[[], Problems], ...] = (
    links,
    contents,
    code_blocks,
    behaviour_pages,
    experiment_pages,
    pictures,
    generated_tables,
    benchmark_rows,
    fleet_keys,
    robot_bytes,
    field_comments,
    protocol_page,
    prose,
)


def main() -> int:
    """Print a line for each problem; 1 if there is one."""
    problems = [problem for check in CHECKS for problem in check()]
    lines = [*problems, f"{len(CHECKS)} checks of the pages; problems: {len(problems)}"]
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    return 1 if problems else 0


def _text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
