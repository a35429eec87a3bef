"""What the command line says of a member: certificates and who may take part, or neither with a warning each time."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import RunAccess
from swarmwire.deploy.certificates.folder import issue
from swarmwire.deploy.certificates.member import member
from swarmwire.deploy.certificates.register import certificate_request

BEYOND, HERE = ("tls/10.0.0.5:7447",), ("unixsock-stream//tmp/x", "tcp/127.0.0.1:1")


@pytest.fixture
def certs(folder: Path, clock) -> Path:
    issue(
        folder,
        [
            certificate_request("world"),
            certificate_request("a", purpose="runner"),
            certificate_request("gate", purpose="router"),
        ],
        365,
        clock,
    )
    return folder


def test_a_folder_says_everything(certs):
    world = member("world", certs=certs, revoked=("b",))
    assert world.access == RunAccess(("a",), routers=("gate",), revoked=("b",))
    assert world.network.certificate == certs / "world.pem"
    assert world.warning(BEYOND) is None


def test_files_and_names_say_the_same(certs):
    files = certs / "ca.pem", certs / "world.pem", certs / "world.key"
    world = member("world", files=files, access=RunAccess(("a",)))
    assert world.access == RunAccess(("a",))
    assert world.network.proves


def test_without_certificates_there_are_no_rights_and_a_warning_beyond_this_machine():
    insecure = member("world", insecure=True)
    assert insecure.access is None
    assert "insecure" in (insecure.warning(["tcp/0.0.0.0:7447"]) or "")
    assert member("world").warning(HERE) is None


def test_a_runners_machine_needs_no_register_but_who_lets_others_in_does(certs, tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    for name in ("ca.pem", "gate.pem", "gate.key"):
        (own / name).write_bytes((certs / name).read_bytes())
    (own / "gate.key").chmod(0o600)
    assert member("runner", certs=own).network.proves
    with pytest.raises(BadInput):
        member("router", certs=own)


@pytest.mark.parametrize(
    "given",
    [
        {"name": "world"},
        {"files": (Path("ca.pem"), None, None)},
        {"access": RunAccess(("a",))},
        {"files": (Path("none"), Path("none"), Path("none"))},
    ],
)
def test_what_contradicts_itself_is_refused(given):
    with pytest.raises(BadInput):
        member("world", **given)


def test_a_folder_excludes_the_rest(certs):
    for given in ({"insecure": True}, {"access": RunAccess(("b",))}, {"files": (certs / "ca.pem", None, None)}):
        with pytest.raises(BadInput):
            member("world", certs=certs, **given)
