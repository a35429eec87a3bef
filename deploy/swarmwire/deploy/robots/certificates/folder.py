"""The folder of a CA: begin the CA, issue and revoke certificates.

ca.pem, ca.key        the CA; its key never leaves this folder
NAME.pem, NAME.key    a certificate and its key, for the machine of that name
certs.json            the register: written last, so what stands in it is there
revoked.crl           the serial numbers that are revoked, for programs that read such lists; zenoh does not
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
    REVOKED,
    CertificateRequest,
    Issued,
    Register,
    certificate_path,
    date_now,
    key_path,
    no_authority,
    text_of,
)

REPLACED = "replaced"  # folder of keys and certificates that new ones replaced


def begin_authority(folder: Path, clock: DatedClock) -> None:
    """Make a CA in a new or empty folder; BadInput for any other folder."""
    now = date_now(clock)
    _make_private_folder(folder)
    with _written(folder):
        write_text(folder / ".gitignore", "*\n")  # no `git add` of the project around it takes the keys along
        authority = Authority.new(now)
        write_key(key_path(folder, AUTHORITY), key_pem(authority.key))
        write_text(certificate_path(folder, AUTHORITY), certificate_pem(authority.certificate))
        register = Register(_entry(AUTHORITY, "CA", (), authority.certificate))
        _write_revoked(folder, authority, register, now)
        register.write(folder)


def issue(
    folder: Path, names: Sequence[CertificateRequest], days: int, clock: DatedClock, *, renew: bool = False
) -> list[Issued]:
    """Make certificates; all names are checked before the first.

    A certificate that ends soon is replaced, with `renew` any other, too. BadInput for a name that is revoked, that has
    a good certificate, or that is asked for twice.
    """
    now = date_now(clock)
    with _written(folder):
        authority, register = Authority.read(folder, now), Register.read(folder)
        for place, of in enumerate(names):
            _check(register, of.name, now, renew=renew)
            if any(of.name.lower() == other.name.lower() for other in names[:place]):
                raise BadInput("NAME", "", f"expected each name once, got {of.name} again")
        for of in names:
            register = register.with_issued(_issue(folder, authority, of, register.last(of.name), days, now))
            register.write(folder)
    return list(register.certificates[-len(names) :]) if names else []


def revoke(folder: Path, name: str, clock: DatedClock) -> None:
    """Put a name's certificates onto the list of those revoked, for good; BadInput for a name that has none."""
    now = date_now(clock)
    with _written(folder):
        authority, register = Authority.read(folder, now), Register.read(folder)
        if register.last(name) is None:
            raise BadInput(str(folder), name, "has no certificate of this CA")
        register = register.with_revoked(name, now)
        register.write(folder)
        _write_revoked(folder, authority, register, now)


def _check(register: Register, name: str, now: datetime, *, renew: bool) -> None:
    """BadInput if the name may not have a certificate now."""
    last = register.last(name)
    other = next((of.name for of in register.certificates if of.name != name and of.name.lower() == name.lower()), None)
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
    folder: Path, authority: Authority, of: CertificateRequest, last: Issued | None, days: int, now: datetime
) -> Issued:
    """Write a key and its certificate, whose place in the register is still to be taken."""
    hosts = of.hosts or (last.hosts if last else ())
    purpose = of.purpose or (last.purpose if last else of.usual_purpose)
    _put_aside(folder, of.name)
    certificate, key = authority.issue(of.name, hosts, days, now)
    write_key(key_path(folder, of.name), key_pem(key))
    write_text(certificate_path(folder, of.name), certificate_pem(certificate))
    return _entry(of.name, purpose, hosts, certificate)


def _entry(name: str, purpose: str, hosts: tuple[str, ...], certificate: x509.Certificate) -> Issued:
    since, until = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    return Issued(name, purpose, f"{certificate.serial_number:x}", hosts, since, until)


def _write_revoked(folder: Path, authority: Authority, register: Register, now: datetime) -> None:
    """Write the list that other programs read, whole from the register."""
    revoked = [(int(of.serial, 16), of.revoked) for of in register.certificates if of.revoked is not None]
    write_text(folder / REVOKED, authority.revocation_list(revoked, now).decode())


@contextmanager
def _written(folder: Path) -> Generator[None]:
    """Keep the folder for this process while the block lasts; BadInput if it is no folder, or cannot be written."""
    try:
        with folder_lock(folder, "folder of certificates"):
            yield
    except FileNotFoundError:
        raise no_authority(folder) from None
    except OSError as error:
        raise BadInput(str(error.filename or folder), "", f"cannot be written: {error.strerror}") from None


def _make_private_folder(path: Path) -> None:
    """A new folder, or an empty one, that its owner alone may enter; BadInput if there is more, or it cannot be."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if any(path.iterdir()):
            raise BadInput(str(path), "", "expected a new or empty folder")
        path.chmod(0o700)
    except OSError as error:
        raise BadInput(str(path), "", f"expected a folder that can be written: {error.strerror}") from None


def _put_aside(folder: Path, name: str) -> None:
    """Move a name's key and certificate, as far as they are there, to where what was replaced is kept."""
    kept = folder / REPLACED
    there = [path for path in (key_path(folder, name), certificate_path(folder, name)) if path.exists()]
    if there:
        kept.mkdir(mode=0o700, exist_ok=True)
        refuse_link(kept)
    number = 1 + len({path.stem for path in kept.glob(f"{name}.*")})
    for path in there:
        path.rename(kept / f"{name}.{number}{path.suffix}")
