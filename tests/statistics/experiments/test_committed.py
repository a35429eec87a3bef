"""What is committed of an experiment belongs together: campaigns, digests, figure, and the numbers on its page."""

import xml.etree.ElementTree as ET

import pytest

from docs.experiments.digest import digests
from docs.experiments.drawing import BEGIN, END
from docs.experiments.experiment import find_experiment, names
from docs.experiments.places import HERE


@pytest.mark.parametrize("name", names(HERE))
def test_each_experiment_has_campaigns_digests_a_figure_and_its_numbers_on_its_page(name):
    experiment = find_experiment(name, HERE)
    assert all((HERE.campaigns / f"{campaign}.toml").exists() for campaign in experiment.campaigns)
    assert ET.parse(HERE.pages / f"{name}.svg").getroot().tag.endswith("svg")
    page = (HERE.pages / f"{name}.md").read_text(encoding="utf-8")
    assert f"({name}.svg)" in page
    told = experiment.told(digests(experiment, HERE))
    assert f"{BEGIN}\n{told}\n{END}" in page, f"python -m docs.experiments draw {name}"
