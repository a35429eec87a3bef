"""What lies in the folder of a CA, and how it is written: whole or not at all, and keys for their owner's eyes only."""

import os
import stat
from pathlib import Path

from swarmwire.comms.errors import BadInput

AUTHORITY = "ca"  # no certificate but the CA's own has this name
REGISTER = "certs.json"
REVOKED = "revoked.crl"
REPLACED = "replaced"  # folder of keys and certificates whose place was taken by new ones


def certificate_path(folder: Path, name: str) -> Path:
    """The certificate of a name, PEM; anybody may read it."""
    return folder / f"{name}.pem"


def key_path(folder: Path, name: str) -> Path:
    """The key of a name, PKCS#8 PEM without a password; only its owner may read it."""
    return folder / f"{name}.key"


def make_private_folder(path: Path) -> None:
    """A new folder, or an empty one, that its owner alone may enter; BadInput if there is more, or it cannot be."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if any(path.iterdir()):
            raise BadInput(str(path), "", "expected a new or empty folder")
        path.chmod(0o700)
    except OSError as error:
        raise BadInput(str(path), "", f"expected a folder that can be written: {error.strerror}") from None


def write_key(path: Path, pem: bytes) -> None:
    """Write a key that none but its owner may read at any time; FileExistsError rather than replace another."""
    aside = path.with_name(f".aside-{path.name}")
    aside.unlink(missing_ok=True)  # of a process that was killed
    descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(pem)
        os.link(aside, path)  # unlike a rename it takes nobody's place
    finally:
        aside.unlink()


def read_key(path: Path) -> bytes:
    """A key as it was written; BadInput if it cannot be read, or others than its owner may."""
    try:
        others = stat.S_IMODE(path.stat().st_mode) & 0o077
        if others:
            raise BadInput(str(path), "", f"expected a key that its owner alone may read: chmod 600 {path}")
        return path.read_bytes()
    except OSError as error:
        raise BadInput(str(path), "", f"expected a readable key: {error.strerror}") from None


def put_aside(folder: Path, name: str) -> None:
    """Move a name's key and certificate, as far as they are there, to where what was replaced is kept."""
    kept = folder / REPLACED
    there = [path for path in (key_path(folder, name), certificate_path(folder, name)) if path.exists()]
    if there:
        kept.mkdir(mode=0o700, exist_ok=True)
    number = 1 + len({path.stem for path in kept.glob(f"{name}.*")})
    for path in there:
        path.rename(kept / f"{name}.{number}{path.suffix}")
