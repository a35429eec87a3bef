"""Dask clusters by their address, and which workers are fit."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.dask_client import address_of
from swarmwire.deploy.campaign.dask_fitness import Fitness
from swarmwire.deploy.campaign.executor import open_executor
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests


def test_without_the_package_it_is_said_how_to_have_it(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"^--on: .*swarmwire\[cluster\]"):
        open_executor("dask://there:8786", None, Path())


@pytest.mark.parametrize(
    ("on", "address"),
    [("dask://there", "there:8786"), ("dask://10.0.0.1:1", "10.0.0.1:1"), ("dask://[::1]:7/", "[::1]:7")],
)
def test_an_address_may_leave_out_the_port(on, address):
    assert address_of(on) == address


@pytest.mark.parametrize("on", ["dask", "dask://", "dask://:8786", "dask://a:b", "dask://a:70000", "dask://tcp://a:1"])
def test_an_address_of_another_form_is_refused(on):
    with pytest.raises(BadInput, match="^--on: .*dask://HOST:PORT"):
        open_executor(on, None, Path())


def card(**other):
    return {"versions": machine.versions(), "modules": module_digests(()), "cpu": machine.cpu(), **other}


def test_workers_are_fit_with_the_same_versions_and_code_alone():
    fitness = Fitness()
    assert (fitness.fault(card()), fitness.warning(card())) == ("", "")
    assert fitness.fault(card(versions={**machine.versions(), "python": "3.9.0"})).startswith("python is 3.9.0")
    assert fitness.fault(card(versions={})).startswith("python is ")
    assert "swarmwire.comms" in fitness.fault(card(modules={}))


def test_each_other_type_of_cpu_is_warned_of_once():
    fitness = Fitness()
    assert fitness.fault(card(cpu="other")) == ""
    assert fitness.warning(card(cpu="other")).startswith("another CPU: other")
    assert fitness.warning(card(cpu="other")) == ""
    assert fitness.warning(card(cpu="third"))
