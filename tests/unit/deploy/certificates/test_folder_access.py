"""A folder of certificates says who may take part in a run, and holds what a machine shows of itself."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import RunAccess
from swarmwire.deploy.certificates.folder import issue, revoke
from swarmwire.deploy.certificates.member import access_in, name_in, network_in
from swarmwire.deploy.certificates.register import PURPOSES, certificate_request
from tests.support.deploy.certificates import DatedFakeClock


@pytest.fixture
def issued(folder: Path, clock: DatedFakeClock) -> Path:
    members = [
        certificate_request("laptop-1", purpose="runner"),
        certificate_request("laptop-2", purpose="runner"),
        certificate_request("wall", purpose="observer"),
        certificate_request("gate", purpose="router"),
        *map(certificate_request, ("world", "operator", "tracker", "flock-0")),
    ]
    issue(folder, members, 365, clock)
    return folder


def test_each_may_do_what_its_certificate_is_for_and_robots_and_trackers_take_no_part(issued, clock):
    revoke(issued, "laptop-2", clock)
    access = access_in(issued)
    assert access == RunAccess(
        ("laptop-1", "laptop-2"), ("wall",), ("operator",), ("gate",), revoked=("laptop-2",), worlds=("world",)
    )
    assert access.without_revoked().runners == ("laptop-1",)


@pytest.mark.parametrize("role", ["runners", "observers", "operators", "routers"])
def test_a_revoked_name_loses_whatever_it_may_do(role: str):
    left = RunAccess(**{role: ("kept", "gone")}, revoked=("gone",)).without_revoked()
    assert getattr(left, role) == ("kept",)


def test_the_last_purpose_of_a_name_counts_and_stays_when_it_is_renewed(issued, clock):
    issue(issued, [certificate_request("wall", purpose="runner")], 365, clock, renew=True)
    issue(issued, [certificate_request("wall")], 365, clock, renew=True)
    access = access_in(issued)
    assert access.observers == ()
    assert access.runners == ("laptop-1", "laptop-2", "wall")


def test_a_certificate_is_found_by_its_name_or_as_the_only_one_for_that_purpose(issued):
    assert name_in(network_in(issued, "world")) == "world"
    network = network_in(issued, "runner", "laptop-2")
    assert (name_in(network), network.ca, network.proves) == ("laptop-2", issued / "ca.pem", True)
    with pytest.raises(BadInput, match="laptop-1, laptop-2"):
        network_in(issued, "runner")
    with pytest.raises(BadInput, match="nobody"):
        network_in(issued, "runner", "nobody")


def test_a_machine_with_its_own_files_alone_needs_no_register(issued, tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    with pytest.raises(BadInput) as refused:
        network_in(own, "runner")
    assert refused.value.where == str(own)
    for name in ("ca.pem", "laptop-1.pem", "laptop-1.key"):
        (own / name).write_bytes((issued / name).read_bytes())
    (own / "laptop-1.key").chmod(0o600)
    assert name_in(network_in(own, "runner")) == "laptop-1"
    with pytest.raises(BadInput):
        access_in(own)


def test_a_purpose_that_nobody_looks_for_is_refused():
    for purpose in PURPOSES:
        assert certificate_request("a", purpose=purpose).purpose == purpose
    with pytest.raises(BadInput, match=r"runner \(did you mean this"):
        certificate_request("a", purpose="runer")
