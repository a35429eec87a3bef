"""What a CA issues: its own certificate, those of others, and their keys, as other programs read them."""

import shutil
import stat
import subprocess
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from swarmwire.deploy.certificates.certificate_folder import begin_authority, issue, revoke
from swarmwire.deploy.certificates.dates import DAY, date_now
from swarmwire.deploy.certificates.files import REVOKED
from swarmwire.deploy.certificates.wanted import wanted
from tests.support.deploy.certificates.dated import DatedFakeClock
from tests.support.deploy.certificates.made import certificate, issued


def test_a_ca_signs_certificates_and_lists_for_ten_years(folder: Path, clock: DatedFakeClock):
    ca = certificate(folder, "ca")
    basic = ca.extensions.get_extension_for_class(x509.BasicConstraints)
    usage = ca.extensions.get_extension_for_class(x509.KeyUsage)
    assert basic.critical
    assert (basic.value.ca, basic.value.path_length) == (True, 0)
    assert (usage.value.key_cert_sign, usage.value.crl_sign, usage.value.digital_signature) == (True, True, False)
    assert (ca.not_valid_after_utc - date_now(clock)).days == 3652


def test_a_certificate_is_a_servers_and_a_clients_of_its_name_and_hosts(folder: Path, clock: DatedFakeClock):
    issue(folder, [wanted("flock-0", ("10.0.0.5", "pi.local", "fe80::1"))], 365, clock)
    leaf = certificate(folder, "flock-0")
    leaf.verify_directly_issued_by(certificate(folder, "ca"))
    names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    purposes = leaf.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert [of.value for of in leaf.subject.get_attributes_for_oid(NameOID.COMMON_NAME)] == ["flock-0"]
    assert names.get_values_for_type(x509.DNSName) == ["flock-0", "pi.local"]
    assert names.get_values_for_type(x509.IPAddress) == [ip_address("10.0.0.5"), ip_address("fe80::1")]
    assert set(purposes) == {ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH}
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert leaf.not_valid_after_utc == date_now(clock) + 365 * DAY
    assert leaf.not_valid_before_utc == date_now(clock) - DAY  # for robots whose clock is late


def test_a_key_is_its_certificates_on_p256_and_its_owners_alone(folder: Path, clock: DatedFakeClock):
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


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_openssl_takes_what_is_good_and_refuses_what_is_revoked(folder: Path):
    from swarmwire.comms.clock import WallClock

    shutil.rmtree(folder)  # openssl knows only today
    begin_authority(folder, WallClock())
    issue(folder, [wanted(name, ("10.0.0.5",)) for name in ("flock-0", "flock-1")], 30, WallClock())
    revoke(folder, "flock-1", WallClock())

    def verified(name: str, *more: str) -> bool:
        command = ["openssl", "verify", "-x509_strict", "-crl_check", "-CRLfile", REVOKED, "-CAfile", "ca.pem", *more]
        return not subprocess.run([*command, f"{name}.pem"], cwd=folder, capture_output=True, check=False).returncode

    assert verified("flock-0", "-purpose", "sslserver", "-verify_ip", "10.0.0.5")
    assert verified("flock-0", "-purpose", "sslclient", "-verify_hostname", "flock-0")
    assert not verified("flock-0", "-verify_ip", "10.0.0.6")
    assert not verified("flock-1")
