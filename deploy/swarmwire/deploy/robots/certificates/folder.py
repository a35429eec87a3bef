"""The folder of a CA: begin the CA, issue and revoke certificates.

ca.pem, ca.key        the CA; its key never leaves this folder
NAME.pem, NAME.key    a certificate and its key, for the machine of that name
certs.json            the register, written after the files that it names
replaced/             keys and certificates that were renewed
"""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from cryptography import x509

from swarmwire.comms.base.atomic import folder_lock, refuse_link, write_text
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.robots.certificates.authority import Authority, certificate_pem, key_pem, write_key
from swarmwire.deploy.robots.certificates.register import (
    AUTHORITY,
    CertificateRequest,
    Issued,
    Register,
    certificate_path,
    date_now,
    key_path,
    no_authority,
    text_of,
)

REPLACED = "replaced"  # subfolder of replaced keys and certificates


def begin_authority(folder: Path, clock: DatedClock) -> None:
    """Create a CA in a new or empty folder; BadInput for any other folder."""
    now = date_now(clock)
    _make_private_folder(folder)
    with _locked(folder):
        write_text(folder / ".gitignore", "*\n")  # keeps the keys out of a surrounding repository
        authority = Authority.new(now)
        write_key(key_path(folder, AUTHORITY), key_pem(authority.key))
        write_text(certificate_path(folder, AUTHORITY), certificate_pem(authority.certificate))
        register = Register(_entry(AUTHORITY, "CA", (), authority.certificate))
        register.write(folder)


def issue(
    folder: Path, requests: Sequence[CertificateRequest], days: int, clock: DatedClock, *, renew: bool = False
) -> list[Issued]:
    """Issue certificates; all requests are checked before the first.

    A certificate that ends soon is replaced, with `renew` any other, too. BadInput for a name that is revoked, has a
    valid certificate, or is requested twice.
    """
    now = date_now(clock)
    with _locked(folder):
        authority, register = Authority.read(folder, now), Register.read(folder)
        for i, request in enumerate(requests):
            _check(register, request.name, now, renew=renew)
            if any(request.name.lower() == other.name.lower() for other in requests[:i]):
                raise BadInput("NAME", "", f"expected each name once, got {request.name} again")
        for request in requests:
            last = register.last(request.name)
            register = register.with_issued(_issue(folder, authority, request, last, days, now))
            register.write(folder)
    return list(register.certificates[-len(requests) :]) if requests else []


def revoke(folder: Path, name: str, clock: DatedClock) -> None:
    """Revoke a name's certificates for good; BadInput for a name without certificates."""
    now = date_now(clock)
    with _locked(folder):
        register = Register.read(folder)
        if register.last(name) is None:
            raise BadInput(str(folder), name, "has no certificate of this CA")
        register.with_revoked(name, now).write(folder)


def _check(register: Register, name: str, now: datetime, *, renew: bool) -> None:
    """Raise BadInput if the name may not get a certificate now."""
    last = register.last(name)
    names = (issued.name for issued in register.certificates)
    other = next((other for other in names if other != name and other.lower() == name.lower()), None)
    if other is not None:
        raise BadInput("NAME", "", f"expected a name that differs from {other} in more than capital letters")
    if last is None:
        return
    if last.revoked is not None:
        raise BadInput(
            "NAME",
            "",
            f"{name} is revoked, and its old key would hold for any new certificate of this name, as zenoh reads no"
            " lists of revoked ones; expected another name, or a CA in another folder: swarmwire certs init DIR",
        )
    if not (renew or last.ends_soon(now)):
        raise BadInput("NAME", "", f"{name} has a certificate until {text_of(last.valid_until)}; --renew makes another")


def _issue(
    folder: Path, authority: Authority, request: CertificateRequest, last: Issued | None, days: int, now: datetime
) -> Issued:
    """Write a key and its certificate; return the entry for the register."""
    hosts = request.hosts or (last.hosts if last else ())
    purpose = request.purpose or (last.purpose if last else request.default_purpose)
    _move_replaced(folder, request.name)
    certificate, key = authority.issue(request.name, hosts, days, now)
    write_key(key_path(folder, request.name), key_pem(key))
    write_text(certificate_path(folder, request.name), certificate_pem(certificate))
    return _entry(request.name, purpose, hosts, certificate)


def _entry(name: str, purpose: str, hosts: tuple[str, ...], certificate: x509.Certificate) -> Issued:
    since, until = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    return Issued(name, purpose, f"{certificate.serial_number:x}", hosts, since, until)


@contextmanager
def _locked(folder: Path) -> Generator[None]:
    """Lock a CA's folder for the block; BadInput if it does not exist or cannot be written."""
    try:
        with folder_lock(folder, "folder of certificates"):
            yield
    except FileNotFoundError:
        raise no_authority(folder) from None
    except OSError as error:
        raise BadInput(str(error.filename or folder), "", f"cannot be written: {error.strerror}") from None


def _make_private_folder(path: Path) -> None:
    """Create a folder that only its owner may enter; BadInput if it has files or cannot be created."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if any(path.iterdir()):
            raise BadInput(str(path), "", "expected a new or empty folder")
        path.chmod(0o700)
    except OSError as error:
        raise BadInput(str(path), "", f"expected a folder that can be written: {error.strerror}") from None


def _move_replaced(folder: Path, name: str) -> None:
    """Move a name's key and certificate, if they exist, to the subfolder of replaced ones."""
    replaced = folder / REPLACED
    paths = [path for path in (key_path(folder, name), certificate_path(folder, name)) if path.exists()]
    if paths:
        replaced.mkdir(mode=0o700, exist_ok=True)
        refuse_link(replaced)
    number = 1 + len({path.stem for path in replaced.glob(f"{name}.*")})
    for path in paths:
        path.rename(replaced / f"{name}.{number}{path.suffix}")
