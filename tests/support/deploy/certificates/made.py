"""Certificates that a test makes and reads."""

from pathlib import Path

from cryptography import x509

from swarmwire.deploy.certificates.folder import issue
from swarmwire.deploy.certificates.register import Issued, certificate_request
from tests.support.deploy.certificates.dated import DatedFakeClock


def issued(folder: Path, clock: DatedFakeClock, *names: str, days: int = 365, renew: bool = False) -> list[Issued]:
    return issue(folder, [certificate_request(name) for name in names], days, clock, renew=renew)


def certificate(folder: Path, name: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes())
