from pathlib import Path

import pytest

from swarmwire.agent.on_robot.proof import check_proof
from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.certificate_folder import begin_authority, issue
from swarmwire.deploy.certificates.wanted import wanted


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> tuple[Path, Path]:
    """Two authorities, each with certificates of two robots."""
    made: list[Path] = []
    for name in ("lab", "other"):
        folder = tmp_path_factory.mktemp(name) / "ca"
        begin_authority(folder, WallClock())
        issue(folder, [wanted("flock-0"), wanted("flock-1")], 30, WallClock())
        made.append(folder)
    return made[0], made[1]


def _check(ca: Path, certificate: Path, key: Path) -> None:
    check_proof(Network(listen=("tls/127.0.0.1:0",), ca=ca, certificate=certificate, key=key), "robot.toml")


def test_what_goes_together_is_taken(folders):
    lab, _ = folders
    _check(lab / "ca.pem", lab / "flock-0.pem", lab / "flock-0.key")


def test_a_certificate_of_another_key_authority_or_none_is_refused_in_one_line(folders):
    lab, other = folders
    refused = {
        "network.key": (lab / "ca.pem", lab / "flock-0.pem", lab / "flock-1.key"),
        "network.certificate": (other / "ca.pem", lab / "flock-0.pem", lab / "flock-0.key"),
        "network.ca": (lab / "flock-0.key", lab / "flock-0.pem", lab / "flock-0.key"),
    }
    for key, files in refused.items():
        with pytest.raises(BadInput) as error:
            _check(*files)
        assert (error.value.where, error.value.key) == ("robot.toml", key)
        assert "\n" not in str(error.value)
