"""From another machine a run is controlled by operators alone; observers may ask how it is, and runners nothing."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import SwarmwireError
from swarmwire.comms.wire.access_control import observers_access
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_observed
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.member import member
from swarmwire.deploy.certificates.register import certificate_request
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.control import remote_control
from swarmwire.deploy.control.control_server import ControlServer, Status
from swarmwire.deploy.control.remote_control import controlling, only_run_at
from swarmwire.deploy.controls import Controls
from swarmwire.deploy.live.following import RunGone
from swarmwire.metrics.measure import Metrics
from tests.support.metrics.truths import static


@pytest.fixture(scope="module")
def certs(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "ca"
    begin_authority(folder, WallClock())
    names = [
        certificate_request("world", ["127.0.0.1"], "world"),
        *(certificate_request(name, [], name) for name in ("operator", "observer", "runner")),
    ]
    issue(folder, names, 2, WallClock())
    return folder


@pytest.fixture
def controls() -> Controls:
    return Controls(WallClock(), 10)


@pytest.fixture
def endpoint(certs, controls) -> Iterator[str]:
    """Where the run `r`, which takes nothing but what controls know, is controlled from elsewhere."""
    metrics, keys, of = Metrics(), ObserverKeys("r"), member("world", certs=certs)
    status = Status(
        run_id="r",
        scenario="s",
        ticks=9,
        metrics=metrics,
        controls=controls,
        clock=WallClock(),
        health=lambda: None,
        counts=dict,
        radio=lambda: None,
        events=list,
    )
    status.begin(static(2))
    assert of.access is not None
    with closed_after(open_observed("tls/127.0.0.1:0", of.network, observers_access(keys, of.access))) as session:
        kept = ControlServer(status, controls, lambda _: 0, lambda _: None, lambda _: None).declare(session, keys)
        token = session.liveliness().declare_token(keys.published)
        yield listens_at(session)[0]
        del kept, token


def test_an_operator_controls_and_an_observer_looks(certs, controls, endpoint, monkeypatch):
    monkeypatch.setattr(remote_control, "ANSWER_S", 3.0)
    operator = member("operator", certs=certs).network
    with controlling(endpoint, only_run_at(endpoint, operator), operator) as control:
        assert (control.status()["run"], control.pause()["done"]) == ("r", "paused")
    assert controls.paused
    observer = member("observer", certs=certs).network
    with controlling(endpoint, only_run_at(endpoint, observer), observer) as control:
        assert control.status()["ticks"] == 9
        with pytest.raises(RunGone, match="nobody answers"):
            control.resume()
    assert controls.paused
    runner = member("runner", certs=certs).network
    with controlling(endpoint, "r", runner) as control:
        for ask in (control.status, control.resume):
            with pytest.raises(RunGone, match="nobody answers"):
                ask()
    assert controls.paused
    with pytest.raises(RunGone, match="found none"):
        only_run_at(endpoint, runner)


def test_who_is_of_another_authority_is_told_that_a_certificate_may_be_at_fault(tmp_path, endpoint):
    begin_authority(tmp_path / "ca", WallClock())
    issue(tmp_path / "ca", [certificate_request("operator", [], "operator")], 2, WallClock())
    with pytest.raises(RunGone, match="cannot be reached.*certificate"):
        only_run_at(endpoint, member("operator", certs=tmp_path / "ca").network)


def test_the_command_line_takes_a_folder_of_certificates(certs, controls, endpoint):
    called = CliRunner().invoke(
        app,
        ["ctl", "--endpoint", endpoint, "--certs", str(certs), "--name", "operator", "step", "3"],
        catch_exceptions=False,
    )
    assert called.output.startswith("3 ticks")
    told = CliRunner().invoke(
        app, ["ctl", "--run", "r", "--endpoint", endpoint, "--certs", str(certs), "status"], catch_exceptions=False
    )
    assert "tick      0 of 9" in told.output
    with pytest.raises(SwarmwireError, match="ca, certificate and key"):
        CliRunner().invoke(app, ["ctl", "--endpoint", endpoint, "status"], catch_exceptions=False)
