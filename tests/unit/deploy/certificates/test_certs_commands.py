"""The command certs, line by line, and the options by which a run becomes a member of a network."""

import json
from pathlib import Path

import pytest

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.wire.access_control import RunAccess
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue, revoke
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.robots.certificates.register import certificate_request
from tests.support.deploy.certificates import DatedFakeClock
from tests.support.deploy.runs import called
from tests.support.refusals import refused_input

FLEET = """
format = 1
swarm = "lab"
certificates = "ca"
operator = "alice"
[defaults]
user = "pi"
agent = "flocking.py:Flock"
driver = { name = "epuck2" }
[robots.flock-0]
address = "10.0.0.10"
[robots.flock-1]
address = "ADDRESS"
"""


class Certs:
    """Calls of the command in this process."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path) -> None:
        self._monkeypatch, self._capsys, self.folder = monkeypatch, capsys, folder

    def __call__(self, command: str, *arguments: str | Path) -> tuple[str, str]:
        """What it prints; `errors` of a call that fails begin with the exit code."""
        code, out, errors = called(self._monkeypatch, self._capsys, "certs", command, self.folder, *arguments)
        return out, errors if code in (0, None) else f"{code} {errors}"


@pytest.fixture
def certs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Certs:
    monkeypatch.setenv("COLUMNS", "160")
    return Certs(monkeypatch, capsys, tmp_path / "ca")


def test_certs_commands_create_issue_revoke_and_list(certs: Certs):
    assert certs("init")[1] == ""
    out, errors = certs("issue", "flock-0", "flock-1", "--host", "10.0.0.5", "--days", "100")
    assert (out.count("written: "), errors) == (2, "")
    assert 'revoked = ["flock-1"]' in certs("revoke", "flock-1")[0]
    out, errors = certs("list")
    assert errors == ""
    rows = [line.split() for line in out.splitlines()[1:]]
    states = {"ca": "valid", "flock-0": "valid", "flock-1": "revoked"}
    assert {row[0]: row[-1] for row in rows} == states
    assert [certificate["state"] for certificate in json.loads(certs("list", "--json")[0])] == [*states.values()]


def test_certs_list_warns_of_certificates_that_end_soon(certs: Certs):
    past = DatedFakeClock("2026-02-01T00:00:00Z")
    begin_authority(certs.folder, past)
    issue(certs.folder, [certificate_request("old")], 1, past)
    issue(certs.folder, [certificate_request("gone")], 1, past)
    certs("revoke", "gone")
    assert certs("list")[1].endswith(f": swarmwire certs issue {certs.folder} old\n")
    certs("issue", "old")
    assert certs("list")[1] == ""


def test_certs_list_warns_of_a_ca_that_ends_soon(certs: Certs):
    begin_authority(certs.folder, DatedFakeClock("2026-02-01T00:00:00Z"))
    register = certs.folder / "certs.json"
    register.write_text(register.read_text().replace('"2036-', '"2026-'))
    assert "swarmwire certs init DIR" in certs("list")[1]


def test_certs_issue_for_a_fleet_adds_missing_certificates(certs: Certs, tmp_path: Path):
    fleet = tmp_path / "fleet.toml"
    fleet.write_text(FLEET.replace("ADDRESS", "10.0.0.11"))
    begin_authority(certs.folder, WallClock())
    issue(certs.folder, [certificate_request("flock-0", ("10.0.0.10",))], 365, WallClock())
    assert names_written(certs("issue", "--fleet", fleet)[0]) == ["flock-1", "tracker", "alice"]
    assert certs("issue", "--fleet", fleet)[1] == ""
    fleet.write_text(FLEET.replace("ADDRESS", "fe80::1"))  # a robot that has moved
    assert names_written(certs("issue", "--fleet", fleet)[0]) == ["flock-1"]
    assert json.loads(certs("list", "--json")[0])[-1]["hosts"] == ["fe80::1"]
    certs("revoke", "flock-0")
    assert certs("issue", "--fleet", fleet)[1].startswith(f"2 error: {fleet}: flock-0: ")


def names_written(out: str) -> list[str]:
    return [Path(line.split()[1]).stem for line in out.splitlines()]


def test_certs_refusals_are_one_line(certs: Certs):
    assert certs("issue", "a")[1].startswith(f"2 error: {certs.folder}: ")
    certs("init")
    for arguments in ((), ("a/b",), ("a", "--host", "b/c"), ("--fleet", "none.toml"), ("a", "--fleet", "none.toml")):
        errors = certs("issue", *arguments)[1]
        assert errors.startswith("2 error: ")
        assert errors.count("\n") == 1


def test_certs_without_the_extra_name_it(certs: Certs, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    errors = certs("init")[1]
    assert errors.startswith("2 error: certs: ")
    assert "install swarmwire[fleet]" in errors
    assert not certs.folder.exists()


BEYOND, LOCALHOST = ("tls/10.0.0.5:7447",), ("unixsock-stream//tmp/x", "tcp/127.0.0.1:1")


@pytest.fixture
def certified(folder: Path, clock) -> Path:
    purposes = {"world": "world", "a": "runner", "gate": "router"}
    issue(folder, [certificate_request(name, purpose=purpose) for name, purpose in purposes.items()], 365, clock)
    return folder


def test_member_reads_rights_and_files_from_a_folder(certified, clock):
    revoke(certified, "gate", clock)
    world = member("world", certs=certified, revoked=("b",))
    assert world.access == RunAccess(("a",), routers=("gate",), revoked=("gate", "b"))
    assert world.network.certificate == certified / "world.pem"
    assert world.warning(BEYOND) is None


def test_member_without_a_register_takes_rights_from_options(certified):
    (certified / "certs.json").unlink()
    world = member("world", certs=certified, name="world", access=RunAccess(("a",)), revoked=("b",))
    assert world.access == RunAccess(("a",), revoked=("b",))
    assert (world.network.certificate, world.network.revoked) == (certified / "world.pem", ("b",))
    with refused_input(match="got a, gate, world: "):
        member("operator", certs=certified)


def test_member_without_certificates_has_no_rights_and_warns_beyond_this_machine():
    insecure = member("world", insecure=True)
    assert insecure.access is None
    assert "insecure" in (insecure.warning(["tcp/0.0.0.0:7447"]) or "")
    assert member("world").warning(LOCALHOST) is None


def test_register_is_needed_by_members_that_listen_alone(certified, tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    for name in ("ca.pem", "gate.pem", "gate.key"):
        (own / name).write_bytes((certified / name).read_bytes())
    (own / "gate.key").chmod(0o600)
    runner = member("runner", certs=own).network
    assert (runner.proves, runner.certificate) == (True, own / "gate.pem")
    with refused_input(match=r"expected certs\.json, or the names of members: --runner NAME"):
        member("router", certs=own)
    assert member("router", certs=own, access=RunAccess(("a",))).access == RunAccess(("a",))


def test_contradictory_options_of_a_member_are_refused(certified):
    only_with_certs = {"name": "world"}, {"access": RunAccess(("a",))}, {"revoked": ("a",)}, {"certs": Path("none")}
    not_beside_a_register = {"insecure": True}, {"access": RunAccess(("b",))}
    for options in (*only_with_certs, *({"certs": certified, **extra} for extra in not_beside_a_register)):
        with refused_input():
            member("world", **options)
