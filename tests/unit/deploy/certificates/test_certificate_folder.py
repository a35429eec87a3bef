"""A folder of certificates: what others read in it, private keys, revoked names, and who may take part in a run."""

import stat
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import RunAccess
from swarmwire.deploy.robots.certificates import folder as certificate_folder
from swarmwire.deploy.robots.certificates.folder import REPLACED, begin_authority, issue, revoke
from swarmwire.deploy.robots.certificates.member import access_in, network_in
from swarmwire.deploy.robots.certificates.register import (
    DAY,
    REGISTER,
    Register,
    certificate_request,
    date_now,
)
from tests.support.deploy.certificates import DatedFakeClock, certificate, issued
from tests.support.refusals import refused_input


def refusal(folder: Path, clock: DatedFakeClock, *names: str) -> str:
    """The message when these are requested, which changes nothing."""
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(BadInput) as refused:
        issued(folder, clock, *names)
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return str(refused.value)


def test_valid_certificate_is_replaced_only_with_renew(folder: Path, clock: DatedFakeClock):
    issue(folder, [certificate_request("flock-0", ("10.0.0.5",))], 365, clock)
    old = (folder / "flock-0.key").read_bytes()
    assert "2027-06-01T12:00:00Z" in refusal(folder, clock, "flock-0")
    (again,) = issued(folder, clock, "flock-0", renew=True)
    assert again.hosts == ("10.0.0.5",)
    assert (folder / REPLACED / "flock-0.1.key").read_bytes() == old != (folder / "flock-0.key").read_bytes()
    issued(folder, clock, "flock-0", renew=True)
    assert (folder / REPLACED / "flock-0.1.key").read_bytes() == old
    register = Register.read(folder)
    states = [state for _, state in register.states(date_now(clock))][1:]
    assert states == ["replaced", "replaced", "valid"]


def test_certificate_that_ends_within_a_month_is_renewed(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0")
    clock.pass_days(334)
    assert "has a certificate" in refusal(folder, clock, "flock-0")
    clock.pass_days(2)
    register = Register.read(folder)
    assert list(register.states(date_now(clock)))[1][1] == "ends soon"
    (again,) = issued(folder, clock, "flock-0")
    assert again.valid_until > register.certificates[0].valid_until


def test_certificate_ends_with_its_ca_at_the_latest(folder: Path, clock: DatedFakeClock):
    clock.pass_days(3652 - 100)
    issued(folder, clock, "flock-0")
    assert certificate(folder, "flock-0").not_valid_after_utc == certificate(folder, "ca").not_valid_after_utc


@pytest.mark.parametrize(
    ("where", "arguments"),
    [
        *(
            ("NAME", (name,))
            for name in ("", "radio/*", "a b", "-a", "a-", "0", "ä", "a" * 64, "a\n", "ca", "CA", "../x")
        ),
        *(
            ("--host", ("flock-0", (host,)))
            for host in ("", "tls/10.0.0.5", "10.0.0.5:7447", "10.0.0.256", "10.0", "a b", "*.lab")
        ),
        ("--for", ("a", (), "runer")),
    ],
)
def test_invalid_name_host_or_purpose_is_refused(where: str, arguments: tuple[Any, ...]):
    with refused_input(where):
        certificate_request(*arguments)


def test_revoked_name_is_listed_and_never_issued_again(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0", "flock-1")
    issued(folder, clock, "flock-0", renew=True)
    revoke(folder, "flock-0", clock)
    revoke(folder, "flock-0", clock)
    register = Register.read(folder)
    assert register.revoked() == ["flock-0"]
    assert [entry.name for entry in register.certificates if entry.revoked is not None] == ["flock-0"] * 2
    clock.pass_days(400)  # nor when all its certificates have ended
    assert "flock-0 is revoked" in refusal(folder, clock, "flock-2", "flock-0")


def test_unknown_name_is_not_revoked_and_a_folder_with_files_becomes_no_ca(folder: Path, clock: DatedFakeClock):
    with refused_input(folder, "flock-9"):
        revoke(folder, "flock-9", clock)
    with refused_input(folder):
        begin_authority(folder, clock)


def test_issue_after_a_killed_process_keeps_its_files_as_replaced(
    folder: Path, clock: DatedFakeClock, monkeypatch: pytest.MonkeyPatch
):
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(certificate_folder, "write_text", killed)
    with pytest.raises(KeyboardInterrupt):
        issued(folder, clock, "flock-0")
    monkeypatch.undo()
    assert Register.read(folder).last("flock-0") is None
    half = (folder / "flock-0.key").read_bytes()
    issued(folder, clock, "flock-0")
    assert (folder / REPLACED / "flock-0.1.key").read_bytes() == half
    key = serialization.load_pem_private_key((folder / "flock-0.key").read_bytes(), None)
    assert key.public_key() == certificate(folder, "flock-0").public_key()


def test_key_that_others_may_read_is_refused_with_a_remedy(folder: Path, clock: DatedFakeClock):
    (folder / "ca.key").chmod(0o640)
    assert refusal(folder, clock, "flock-0").endswith(f"chmod 600 {folder / 'ca.key'}")


def test_ca_outside_its_validity_issues_nothing(folder: Path, clock: DatedFakeClock):
    clock.pass_days(-2)
    assert "began, 2026-05-31T12:00:00Z" in refusal(folder, clock, "flock-0")
    clock.pass_days(2 + 3652)
    assert "ended on 2036-05-31T12:00:00Z" in refusal(folder, clock, "flock-0")


def test_clock_that_was_never_set_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match="1970-01-01T00:00:05Z"):
        begin_authority(tmp_path / "ca", DatedFakeClock("1970-01-01T00:00:05Z"))
    assert not (tmp_path / "ca").exists()


@pytest.mark.parametrize(
    ("damage", "where"),
    [
        *(("remove", ""), ("no-pem", ""), ("no-register", "")),
        *(("remove-key", "ca.key"), ("other-key", "ca.key"), ("half-register", REGISTER)),
    ],
)
def test_damaged_file_of_a_ca_is_named(folder: Path, clock: DatedFakeClock, tmp_path: Path, damage: str, where: str):
    register, key = folder / REGISTER, folder / "ca.key"
    if damage == "remove":
        folder.rename(tmp_path / "elsewhere")
    elif damage == "remove-key":
        key.unlink()
    elif damage == "other-key":
        begin_authority(tmp_path / "other", clock)
        key.write_bytes((tmp_path / "other" / "ca.key").read_bytes())
    elif damage == "no-pem":
        key.write_bytes(b"a key")
    elif damage == "no-register":
        register.unlink()
    else:
        register.write_text(register.read_text()[:-20])
    assert refusal(folder, clock, "flock-0").startswith(f"{folder / where}: ")


def test_names_that_differ_only_in_capitals_are_refused(folder: Path, clock: DatedFakeClock):
    assert refusal(folder, clock, "flock-0", "Flock-0").startswith("NAME: ")
    issued(folder, clock, "flock-0")
    assert refusal(folder, clock, "FLOCK-0").startswith("NAME: ")


def test_ca_signs_certificates_for_ten_years(folder: Path, clock: DatedFakeClock):
    ca = certificate(folder, "ca")
    basic = ca.extensions.get_extension_for_class(x509.BasicConstraints)
    usage = ca.extensions.get_extension_for_class(x509.KeyUsage)
    assert basic.critical
    assert (basic.value.ca, basic.value.path_length) == (True, 0)
    assert (usage.value.key_cert_sign, usage.value.crl_sign, usage.value.digital_signature) == (True, False, False)
    assert (ca.not_valid_after_utc - date_now(clock)).days == 3652


def test_certificate_is_for_server_and_client_with_name_and_hosts(folder: Path, clock: DatedFakeClock):
    issue(folder, [certificate_request("flock-0", ("10.0.0.5", "pi.local", "fe80::1"))], 365, clock)
    leaf = certificate(folder, "flock-0")
    leaf.verify_directly_issued_by(certificate(folder, "ca"))
    names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    purposes = leaf.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert [attribute.value for attribute in leaf.subject.get_attributes_for_oid(NameOID.COMMON_NAME)] == ["flock-0"]
    assert names.get_values_for_type(x509.DNSName) == ["flock-0", "pi.local"]
    assert names.get_values_for_type(x509.IPAddress) == [ip_address("10.0.0.5"), ip_address("fe80::1")]
    assert set(purposes) == {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH}
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert leaf.not_valid_after_utc == date_now(clock) + 365 * DAY
    assert leaf.not_valid_before_utc == date_now(clock) - DAY  # for robots whose clock is late


def test_key_is_on_p256_fits_its_certificate_and_is_private(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for name in ("ca", "flock-0"):
        path = folder / f"{name}.key"
        key = serialization.load_pem_private_key(path.read_bytes(), None)
        assert isinstance(key, ec.EllipticCurvePrivateKey)
        assert isinstance(key.curve, ec.SECP256R1)
        assert key.public_key() == certificate(folder, name).public_key()
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert path.read_text().startswith("-----BEGIN PRIVATE KEY-----")  # PKCS#8


@pytest.fixture
def registered(folder: Path, clock: DatedFakeClock) -> Path:
    purposes = {"laptop-1": "runner", "laptop-2": "runner", "wall": "observer", "gate": "router"}
    members = [certificate_request(name, purpose=purpose) for name, purpose in purposes.items()]
    members += map(certificate_request, ("world", "operator", "tracker", "flock-0"))
    issue(folder, members, 365, clock)
    return folder


def test_rights_follow_the_purposes_of_certificates(registered, clock):
    revoke(registered, "laptop-2", clock)
    access = access_in(registered)
    assert access == RunAccess(
        ("laptop-1", "laptop-2"), ("wall",), ("operator",), ("gate",), revoked=("laptop-2",), worlds=("world",)
    )
    assert access.without_revoked().runners == ("laptop-1",)


@pytest.mark.parametrize("role", ["runners", "observers", "operators", "routers"])
def test_revoked_name_has_no_rights(role: str):
    access = RunAccess(**{role: ("kept", "gone")}, revoked=("gone",)).without_revoked()
    assert getattr(access, role) == ("kept",)


def test_purpose_of_a_name_is_the_last_and_survives_renewal(registered, clock):
    issue(registered, [certificate_request("wall", purpose="runner")], 365, clock, renew=True)
    issue(registered, [certificate_request("wall")], 365, clock, renew=True)
    access = access_in(registered)
    assert access.observers == ()
    assert access.runners == ("laptop-1", "laptop-2", "wall")


def test_certificate_is_selected_by_name_or_by_a_unique_purpose(registered):
    assert network_in(registered, "world").certificate == registered / "world.pem"
    network = network_in(registered, "runner", "laptop-2")
    assert (network.certificate, network.ca) == (registered / "laptop-2.pem", registered / "ca.pem")
    assert network.proves
    with pytest.raises(BadInput, match="laptop-1, laptop-2"):
        network_in(registered, "runner")
    with pytest.raises(BadInput, match="nobody"):
        network_in(registered, "runner", "nobody")


def test_folder_without_anything_has_no_network_and_no_rights(tmp_path):
    with refused_input(tmp_path):
        network_in(tmp_path, "runner")
    with refused_input(tmp_path):
        access_in(tmp_path)
