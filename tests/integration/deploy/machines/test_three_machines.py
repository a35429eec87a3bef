"""World, router and runners on three machines, with mutual TLS: the run is that of one process."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.deploy import run
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.register import certificate_request
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.machines.namespaces import machines
from tests.support.deploy.machines.on_machines import on

SHORT = "duration_s=3"


def lab(folder: Path, addresses: Mapping[str, Sequence[str]], *runners: str) -> Path:
    """A CA, certificates of the world and of routers at their addresses, and of runners."""
    begin_authority(folder, WallClock())
    members = [
        certificate_request(name, at, "world" if name == "world" else "router") for name, at in addresses.items()
    ]
    issue(folder, [*members, *(certificate_request(name, purpose="runner") for name in runners)], 1, WallClock())
    return folder


def summary(out: Path) -> dict[str, object]:
    return json.loads((out / "summary.json").read_text())


def test_a_run_across_three_machines_is_the_run_of_one_process(tmp_path):
    with machines(3) as (far, between, near):
        certs = lab(tmp_path / "ca", {"world": far.addresses, "gate": between.addresses}, "r1", "r2")
        at, through = (f"tls/{address}:7447" for address in (far.addresses[0], between.addresses[1]))
        out, given = tmp_path / "out", ("--certs", certs)
        with (
            on(between, "router", "--listen", through, "--connect", at, *given) as router,
            on(far, "world", LOSSY, "--set", SHORT, "--listen", at, "--out", out, "--no-rrd", *given) as world,
        ):
            router.said("linked with world")
            joined = [on(near, "join", through, "--robots", "10", "--name", name, *given) for name in ("r1", "r2")]
            with joined[0] as one, joined[1] as other:
                assert (world.ended(), one.ended(), other.ended()) == (0, 0, 0), (world.lines, one.lines, other.lines)
            assert router.stop() == 0
    alone = run(LOSSY, overrides=[SHORT])
    assert summary(out)["trajectory_sha256"] == list(alone.trajectory_sha256)
    assert {line for line in router.lines if "linked" in line} >= {"router: linked with r1", "router: linked with r2"}


def test_nobody_gets_past_a_machine_without_a_router(tmp_path):
    with machines(3) as (far, _, near):
        certs = lab(tmp_path / "ca", {"world": far.addresses}, "r1")
        at = f"tls/{far.addresses[0]}:7447"
        with on(far, "world", LOSSY, "--listen", at, "--out", tmp_path / "out", "--certs", certs) as world:
            world.said("listens at")
            with on(near, "join", at, "--name", "r1", "--certs", certs) as stray:
                assert stray.ended() != 0
            assert "nobody answers" in stray.lines[-1]
