"""Gateways are found by name; what is missing, twice there, or none is told in one line."""

from importlib.metadata import EntryPoint

import pytest

from swarmwire.comms import plugins as installed_classes
from swarmwire.comms.errors import BadInput
from swarmwire.world.gateways import gateway
from tests.support.world.gateways.scripted import ScriptedGateway

HERE = "tests.support.world.gateways.scripted:ScriptedGateway"


def installed(monkeypatch: pytest.MonkeyPatch, *points: tuple[str, str]) -> None:
    found = [EntryPoint(name, value, gateway.GROUP) for name, value in points]
    monkeypatch.setattr(installed_classes, "entry_points_of", lambda group: found if group == gateway.GROUP else [])


def refused(name: str) -> str:
    with pytest.raises(BadInput) as caught:
        gateway.gateway_kind(name, "--gateway", name)
    text = str(caught.value)
    assert text.startswith(f"--gateway: {name}: ")
    assert "\n" not in text
    return text


def test_those_that_come_with_swarmwire_are_known_without_being_imported() -> None:
    assert set(gateway.gateway_names()) >= {"epuck2", "ros2"}


def test_a_gateway_is_found_by_its_name(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE))
    assert gateway.gateway_kind("scripted", "--gateway") is ScriptedGateway


def test_an_unknown_name_is_refused_with_those_there_are(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE))
    assert "scripted" in refused("epuck3")


def test_a_name_that_two_packages_bring_is_refused(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE), ("scripted", "other.package:Gateway"))
    assert "other.package:Gateway" in refused("scripted")


def test_a_package_that_is_missing_is_named(monkeypatch) -> None:
    installed(monkeypatch, ("far", "a_package_that_is_not_here:Gateway"))
    assert "does not import: No module named 'a_package_that_is_not_here'" in refused("far")


@pytest.mark.parametrize(
    "value", ["swarmwire.world.gateways.gateway:Nothing", "swarmwire.world.gateways.gateway:GROUP"]
)
def test_what_is_no_gateway_is_refused(monkeypatch, value) -> None:
    installed(monkeypatch, ("odd", value))
    refused("odd")
