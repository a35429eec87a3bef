"""What a CA issues: its own certificate, those of others, and their keys, as other programs read them."""

import stat
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from swarmwire.deploy.certificates.folder import issue
from swarmwire.deploy.certificates.register import DAY, certificate_request, date_now
from tests.support.deploy.certificates import DatedFakeClock, certificate, issued


def test_a_ca_signs_certificates_and_lists_for_ten_years(folder: Path, clock: DatedFakeClock):
    ca = certificate(folder, "ca")
    basic = ca.extensions.get_extension_for_class(x509.BasicConstraints)
    usage = ca.extensions.get_extension_for_class(x509.KeyUsage)
    assert basic.critical
    assert (basic.value.ca, basic.value.path_length) == (True, 0)
    assert (usage.value.key_cert_sign, usage.value.crl_sign, usage.value.digital_signature) == (True, True, False)
    assert (ca.not_valid_after_utc - date_now(clock)).days == 3652


def test_a_certificate_is_a_servers_and_a_clients_of_its_name_and_hosts(folder: Path, clock: DatedFakeClock):
    issue(folder, [certificate_request("flock-0", ("10.0.0.5", "pi.local", "fe80::1"))], 365, clock)
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
