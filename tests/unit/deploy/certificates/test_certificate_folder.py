"""A CA's folder: what it issues holds as it should, keys stay private and whole, revoked names never come back."""

from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.certificates import folder as certificate_folder
from swarmwire.deploy.certificates.folder import REPLACED, begin_authority, issue, renew_authority, revoke
from swarmwire.deploy.certificates.register import REGISTER, REVOKED, Register, certificate_request, date_now
from tests.support.deploy.certificates import DatedFakeClock, certificate, issued


def refusal(folder: Path, clock: DatedFakeClock, *names: str) -> str:
    """What is said when these are asked for, which changes nothing."""
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(BadInput) as refused:
        issued(folder, clock, *names)
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return str(refused.value)


def test_a_good_certificate_is_replaced_only_where_that_is_asked_for(folder: Path, clock: DatedFakeClock):
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


def test_a_certificate_that_ends_within_a_month_may_be_renewed(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0")
    clock.pass_days(334)
    assert "has a certificate" in refusal(folder, clock, "flock-0")
    clock.pass_days(2)
    register = Register.read(folder)
    assert list(register.states(date_now(clock)))[1][1] == "ends soon"
    (again,) = issued(folder, clock, "flock-0")
    assert again.valid_until > register.certificates[0].valid_until


def test_a_certificate_ends_with_its_ca_at_the_latest(folder: Path, clock: DatedFakeClock):
    clock.pass_days(3652 - 100)
    issued(folder, clock, "flock-0")
    assert certificate(folder, "flock-0").not_valid_after_utc == certificate(folder, "ca").not_valid_after_utc


def test_a_revoked_name_is_listed_and_never_issued_again(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0", "flock-1")
    issued(folder, clock, "flock-0", renew=True)
    revoke(folder, "flock-0", clock)
    revoke(folder, "flock-0", clock)
    register = Register.read(folder)
    assert register.revoked() == ["flock-0"]
    listed = x509.load_pem_x509_crl((folder / REVOKED).read_bytes())
    assert listed.is_signature_valid(certificate(folder, "ca").public_key())
    serials = {of.serial_number for of in listed}
    assert serials == {int(of.serial, 16) for of in register.certificates if of.name == "flock-0"}
    clock.pass_days(400)  # nor when all its certificates have ended
    assert "flock-0 is revoked" in refusal(folder, clock, "flock-2", "flock-0")


def test_a_name_without_certificate_cannot_be_revoked(folder: Path, clock: DatedFakeClock):
    with pytest.raises(BadInput) as refused:
        revoke(folder, "flock-9", clock)
    assert (refused.value.where, refused.value.key) == (str(folder), "flock-9")


def test_a_renewed_ca_knows_no_names_and_the_old_one_is_kept(folder: Path, clock: DatedFakeClock):
    issued(folder, clock, "flock-0")
    revoke(folder, "flock-0", clock)
    old = (folder / "ca.key").read_bytes()
    kept = renew_authority(folder, clock)
    assert kept.name == "ca-until-20260601T120000Z"
    assert (kept / "ca.key").read_bytes() == old != (folder / "ca.key").read_bytes()
    assert [of.name for of in issued(folder, clock, "flock-0")] == ["flock-0"]


def test_a_ca_is_begun_in_no_folder_that_has_something(folder: Path, clock: DatedFakeClock):
    with pytest.raises(BadInput) as refused:
        begin_authority(folder, clock)
    assert refused.value.where == str(folder)


def test_what_a_killed_process_left_behind_is_put_aside_and_kept(
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


def test_a_key_that_others_may_read_is_refused_with_the_cure(folder: Path, clock: DatedFakeClock):
    (folder / "ca.key").chmod(0o640)
    assert refusal(folder, clock, "flock-0").endswith(f"chmod 600 {folder / 'ca.key'}")


def test_a_ca_that_has_ended_or_not_begun_issues_nothing(folder: Path, clock: DatedFakeClock):
    clock.pass_days(-2)
    assert "began, 2026-05-31T12:00:00Z" in refusal(folder, clock, "flock-0")
    clock.pass_days(2 + 3652)
    assert "ended on 2036-05-31T12:00:00Z" in refusal(folder, clock, "flock-0")


def test_a_clock_that_was_never_set_dates_nothing(tmp_path: Path):
    with pytest.raises(BadInput, match="1970-01-01T00:00:05Z"):
        begin_authority(tmp_path / "ca", DatedFakeClock("1970-01-01T00:00:05Z"))
    assert not (tmp_path / "ca").exists()


@pytest.mark.parametrize(
    ("damage", "where"),
    [
        ("remove", ""),
        ("remove-key", "ca.key"),
        ("other-key", "ca.key"),
        ("no-pem", ""),
        ("no-register", ""),
        ("half-register", REGISTER),
    ],
)
def test_what_is_damaged_in_a_folder_is_named(
    folder: Path, clock: DatedFakeClock, tmp_path: Path, damage: str, where: str
):
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


@pytest.mark.parametrize("name", ["", "radio/*", "a b", "-a", "a-", "0", "ä", "a" * 64, "a\n", "ca", "CA", "../x"])
def test_a_bad_name_is_refused(name: str):
    with pytest.raises(BadInput, match="^NAME: "):
        certificate_request(name)


@pytest.mark.parametrize("host", ["", "tls/10.0.0.5", "10.0.0.5:7447", "10.0.0.256", "10.0", "a b", "*.lab"])
def test_a_bad_host_is_refused(host: str):
    with pytest.raises(BadInput, match="^--host: "):
        certificate_request("flock-0", (host,))


def test_names_that_one_file_might_hold_are_refused(folder: Path, clock: DatedFakeClock):
    assert refusal(folder, clock, "flock-0", "Flock-0").startswith("NAME: ")
    issued(folder, clock, "flock-0")
    assert refusal(folder, clock, "FLOCK-0").startswith("NAME: ")
