"""`swarmwire radio probe`: the figures by which radios are compared, as JSON."""

import json

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli import app


def probe(*arguments: str) -> dict[str, float]:
    done = CliRunner().invoke(app, ["radio", "probe", *arguments, "--runs", "2", "--measured-s", "0.5"])
    if done.exception is not None:
        raise done.exception
    return json.loads(done.stdout)


def test_contention_costs_delivery_and_time():
    few, many = (probe("ieee802154", "--contention", f"{nodes},20,0.1") for nodes in (2, 40))
    assert few["delivery_ratio"] > 0.95 > many["delivery_ratio"]
    assert few["mean_delay_s"] < many["mean_delay_s"]


def test_values_of_the_radio_may_be_set():
    assert probe("ideal", "--contention", "3,20,0.1", "--set", "radio.loss=1.0")["delivery_ratio"] == 0.0


@pytest.mark.parametrize("arguments", [("x", "--contention", "2,20,0.1"), ("disk", "--contention", "1,20,0.1")])
def test_what_makes_no_probe_is_refused(arguments):
    with pytest.raises(BadInput, match="expected"):
        probe(*arguments)
