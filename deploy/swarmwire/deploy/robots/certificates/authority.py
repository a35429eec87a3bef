"""A certificate authority (CA): an EC key on P-256 and its own certificate; it signs the certificates of others.

The key files are readable by their owner alone.
"""

import ipaddress
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from swarmwire.comms.base.atomic import PRIVATE, write_bytes
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.certificates.register import (
    AUTHORITY,
    DAY,
    certificate_path,
    key_path,
    no_authority,
    text_of,
)

AUTHORITY_DAYS = 3652  # ten years
CLOCK_MARGIN = DAY  # certificates begin this much earlier: clocks of robots without a battery are slow


@dataclass(frozen=True)
class Authority:
    """A CA with its key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey

    @classmethod
    def new(cls, now: datetime) -> "Authority":
        """Create a CA, valid for ten years, which signs certificates of the network's members and nothing else."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = _name(f"swarmwire CA {text_of(now)}")
        builder = _builder(name, name, key.public_key(), now, now + AUTHORITY_DAYS * DAY)
        builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        builder = builder.add_extension(_usage(signs_certificates=True), critical=True)
        return cls(builder.sign(key, hashes.SHA256()), key)

    @classmethod
    def read(cls, folder: Path, now: datetime) -> "Authority":
        """Read a folder's CA; BadInput unless its files are private, belong together and are valid at that date."""
        path = certificate_path(folder, AUTHORITY)
        if not path.is_file():
            raise no_authority(folder)
        pem = read_key(key_path(folder, AUTHORITY))
        try:
            certificate = x509.load_pem_x509_certificate(path.read_bytes())
            key = serialization.load_pem_private_key(pem, None)
        except (ValueError, TypeError, UnsupportedAlgorithm):
            raise BadInput(str(folder), "", f"expected PEM in {AUTHORITY}.pem and {AUTHORITY}.key") from None
        if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != certificate.public_key():
            raise BadInput(str(key_path(folder, AUTHORITY)), "", f"expected the key of {path.name}")
        _check_date(folder, certificate, now)
        return cls(certificate, key)

    def issue(
        self, name: str, hosts: Sequence[str], days: int, now: datetime
    ) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
        """Return a new key, and its certificate as server and client for a name and hosts.

        The certificate is valid for `days`, but not longer than the CA.
        """
        key = ec.generate_private_key(ec.SECP256R1())
        until = min(now + days * DAY, self.certificate.not_valid_after_utc)
        purposes = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        names = [_general_name(host) for host in (name, *hosts)]
        issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(self.key.public_key())
        builder = _builder(_name(name), self.certificate.subject, key.public_key(), now, until)
        builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        builder = builder.add_extension(_usage(signs_certificates=False), critical=True)
        builder = builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        builder = builder.add_extension(x509.SubjectAlternativeName(names), False)
        builder = builder.add_extension(issuer, critical=False)
        return builder.sign(self.key, hashes.SHA256()), key


def certificate_pem(certificate: x509.Certificate) -> str:
    """Return a certificate as text in PEM."""
    return certificate.public_bytes(serialization.Encoding.PEM).decode()


def key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """Return a key in PEM: PKCS#8, as zenoh expects it, without a password."""
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def write_key(path: Path, pem: bytes) -> None:
    """Write a key that only its owner may read at any time; FileExistsError if the file exists."""
    write_bytes(path, pem, mode=PRIVATE, replace=False)


def read_key(path: Path) -> bytes:
    """Read a key; BadInput if it cannot be read, or others than its owner may read it."""
    try:
        others_mode = stat.S_IMODE(path.stat().st_mode) & 0o077
        if others_mode:
            raise BadInput(str(path), "", f"expected a key that its owner alone may read: chmod 600 {path}")
        return path.read_bytes()
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable key: {error.strerror}") from None


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, now: datetime, until: datetime
) -> x509.CertificateBuilder:
    builder = x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key)
    builder = builder.serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(now - CLOCK_MARGIN).not_valid_after(until)
    return builder.add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _check_date(folder: Path, certificate: x509.Certificate, now: datetime) -> None:
    until, since = certificate.not_valid_after_utc, certificate.not_valid_before_utc
    where = str(certificate_path(folder, AUTHORITY))
    if now >= until:
        raise BadInput(
            where, "", f"the CA ended on {text_of(until)}; make one in another folder: swarmwire certs init DIR"
        )
    if now < since:
        raise BadInput(
            where, "", f"the clock shows {text_of(now)}, before the CA began, {text_of(since)}: set the clock"
        )
