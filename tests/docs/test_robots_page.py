"""The page about real robots: what it does without one happens."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from swarmwire.agent.radios.tracker import Tracker
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.wire.access_control import access_of
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import endpoints_of, open_swarm
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.register import certificate_request
from tests.docs.pages import ROOT, environment
from tests.support.clocks import until

PAGE = "docs/robots.md"
TRIED = re.compile(r"^<!-- try: (\w+) -->\n```text\n(.*?)\n```$", re.DOTALL | re.MULTILINE)
ROBOTS = ("flock-0", "flock-1")


@contextmanager
def terminal(line: str) -> Generator[subprocess.Popen[str]]:
    """A shell that is given a line of the page, and Ctrl-C at the end."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(["bash", "-c", line], start_new_session=True, env=environment(), **pipes) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            process.communicate()


def read_until(process: subprocess.Popen[str], text: str) -> list[str]:
    """What the process prints, up to the first line with this."""
    lines = list[str]()
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError("".join(lines))


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_rehearsal_of_the_page_runs_agents_that_hear_one_another(tmp_path, monkeypatch):
    lines = dict(TRIED.findall((ROOT / PAGE).read_text(encoding="utf-8")))
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    monkeypatch.chdir(tmp_path)
    with terminal(f"{lines['world']} --set duration_s=40") as world:
        table = read_until(world, "ticks at 10 Hz")
        assert sum("swarmwire-agent run --config" in line for line in table) == 3
        with terminal(lines["agents"]) as agents:
            read_until(agents, "Flocking on epuck2 by epuck2")
            read_until(world, "link PDR so far 0")


@pytest.fixture
def certs(tmp_path) -> Path:
    """A folder with the certificates of a robot and of the tracker."""
    begin_authority(tmp_path / "lab-ca", WallClock())
    requests = [certificate_request(name, ("127.0.0.1",)) for name in ("flock-0", "tracker")]
    issue(tmp_path / "lab-ca", requests, 1, WallClock())
    return tmp_path / "lab-ca"


@contextmanager
def listening(certs: Path | None) -> Generator[tuple[Tracker, Sequence[str]]]:
    """What an agent does with poses, and its endpoints."""
    keys = SwarmKeys("lab")
    network = Network(("tcp/127.0.0.1:0",))
    if certs:
        own = {"ca": certs / "ca.pem", "certificate": certs / "flock-0.pem", "key": certs / "flock-0.key"}
        network = Network(("tls/127.0.0.1:0",), **own)
    with closing(open_swarm(network, access_of(network, keys, ROBOTS, "flock-0"), small=False)) as session:
        tracker = Tracker(session, keys, ROBOTS)
        tracker.open()
        yield tracker, endpoints_of(session, network)
        tracker.close()


def fed(*words: object) -> subprocess.CompletedProcess[str]:
    """Lines of a camera for the pose feed with these words."""
    command = [sys.executable, "-m", "swarmwire.agent.pose_feed", "lab", *map(str, words)]
    lines = "flock-1 1.20 0.35\nflock-1 1.20 0.35 1.57\n"
    return subprocess.run(command, input=lines, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("proven", [True, False])
def test_camera_line_becomes_a_pose_with_and_without_certificates(certs: Path, proven: bool):
    with listening(certs if proven else None) as (tracker, endpoints):
        done = fed(*endpoints, *(["--certs", certs] if proven else ["--insecure"]))
        linked, refused = done.stderr.splitlines()
        assert (done.returncode, linked) == (0, "linked with 1 of 1")
        assert refused.endswith("'flock-1 1.20 0.35'")
        assert until(lambda: tracker.pose("flock-1", WallClock().utc_ns())) == (1.20, 0.35, 1.57)


def test_camera_with_a_certificate_of_another_ca_reaches_no_agent(certs: Path, tmp_path: Path):
    begin_authority(tmp_path / "other", WallClock())
    issue(tmp_path / "other", [certificate_request("tracker", ())], 1, WallClock())
    with listening(certs) as (tracker, endpoints):
        done = fed(*endpoints, "--certs", tmp_path / "other")
        assert done.returncode == 1
        assert "no agent listens for poses of 'lab'" in done.stderr
        assert tracker.pose("flock-1", WallClock().utc_ns()) is None


def test_pose_feed_beyond_this_machine_needs_certificates_or_insecure():
    done = fed("tcp/192.0.2.1:7557")
    assert done.returncode == 2
    assert done.stderr.endswith("reaches beyond this machine; expected --certs, or --insecure\n")
