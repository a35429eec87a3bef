"""The figure and the numbers of an experiment, made from its digests."""

from pathlib import Path

from docs.experiments.digest import digests
from docs.experiments.experiment import Experiment
from docs.experiments.places import Places
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.drawing.canvas import save

BEGIN, END = "<!-- numbers -->", "<!-- /numbers -->"


def draw(experiment: Experiment, places: Places) -> str:
    """Draw an experiment, put its numbers into its page if there is one, and return them.

    BadInput where a digest is missing, or the page has no place for the numbers.
    """
    runs = digests(experiment, places)
    told = experiment.told(runs)
    page = places.pages / f"{experiment.name}.md"
    text = with_numbers(page, told) if page.exists() else None
    save(experiment.draw(runs), places.figure_of(experiment.name))
    if text is not None:
        write_text(page, text)
    return told


def with_numbers(page: Path, told: str) -> str:
    """The page's text with these numbers between its marks; BadInput unless it has both, once."""
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise BadInput(str(page), "", f"expected one line {BEGIN}, and {END} below it")
    return f"{text.partition(BEGIN)[0]}{BEGIN}\n{told}\n{END}{text.partition(END)[2]}"
