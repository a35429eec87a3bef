"""What another program makes of our certificates."""

import shutil
import subprocess
from pathlib import Path

import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.certificates.folder import begin_authority, issue, revoke
from swarmwire.deploy.certificates.register import REVOKED, certificate_request


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_openssl_takes_what_is_good_and_refuses_what_is_revoked(tmp_path: Path):
    folder = tmp_path / "ca"
    begin_authority(folder, WallClock())
    issue(folder, [certificate_request(name, ("10.0.0.5",)) for name in ("flock-0", "flock-1")], 30, WallClock())
    revoke(folder, "flock-1", WallClock())

    def verified(name: str, *more: str) -> bool:
        command = ["openssl", "verify", "-x509_strict", "-crl_check", "-CRLfile", REVOKED, "-CAfile", "ca.pem", *more]
        return not subprocess.run([*command, f"{name}.pem"], cwd=folder, capture_output=True, check=False).returncode

    assert verified("flock-0", "-purpose", "sslserver", "-verify_ip", "10.0.0.5")
    assert verified("flock-0", "-purpose", "sslclient", "-verify_hostname", "flock-0")
    assert not verified("flock-0", "-verify_ip", "10.0.0.6")
    assert not verified("flock-1")
