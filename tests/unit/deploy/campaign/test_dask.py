"""Dask clusters by their address, and which workers fit."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.dask import address_of, environment, fault_of
from swarmwire.deploy.campaign.schedule import open_executor


def test_without_the_package_it_is_said_how_to_have_it(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"^--executor: .*swarmwire\[cluster\]"):
        open_executor("dask://there:8786", None, Path())


@pytest.mark.parametrize(
    ("name", "address"),
    [("dask://there", "there:8786"), ("dask://10.0.0.1:1", "10.0.0.1:1"), ("dask://[::1]:7/", "[::1]:7")],
)
def test_an_address_may_leave_out_the_port(name, address):
    assert address_of(name) == address


@pytest.mark.parametrize(
    "name", ["dask", "dask://", "dask://:8786", "dask://a:b", "dask://a:70000", "dask://tcp://a:1"]
)
def test_an_address_of_another_form_is_refused(name):
    with pytest.raises(BadInput, match="^--executor: .*dask://HOST:PORT"):
        open_executor(name, None, Path())


def test_workers_fit_with_the_same_versions_and_code_whatever_their_cpu():
    here = environment()
    assert fault_of(here, {**here, "cpu": "other"}) == ""
    assert fault_of(here, {**here, "versions": {**here["versions"], "python": "3.9.0"}}).startswith("python is 3.9.0")
    assert fault_of(here, {**here, "versions": {}}).startswith("python is not there")
    assert "swarmwire.comms" in fault_of(here, {**here, "modules": {}})
