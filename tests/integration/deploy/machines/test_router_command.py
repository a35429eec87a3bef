"""`swarmwire router` as it is called: what it refuses, warns of, prints, and how it ends."""

import json
from pathlib import Path

import pytest
import zenoh

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.certificates.folder import revoke
from tests.integration.deploy.machines.test_three_machines import lab
from tests.support.deploy.commands import called
from tests.support.deploy.machines.on_machines import on

HERE = ("127.0.0.1",)
TCP = ("--listen", "tcp/127.0.0.1:0", "--connect", "tcp/127.0.0.1:1")
TLS = ("--listen", "tls/127.0.0.1:0", "--connect", "tls/127.0.0.1:1")


@pytest.fixture(scope="module")
def certs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = lab(tmp_path_factory.mktemp("lab") / "ca", {"world": HERE, "gate": HERE, "gate2": HERE}, "r1", "gone")
    revoke(folder, "gone", WallClock())
    return folder


def test_on_this_machine_it_routes_without_certificates_until_it_is_asked_to_end():
    with on(None, "router", *TCP) as router:
        assert router.said("listens at").endswith(", calls tcp/127.0.0.1:1")
        assert router.stop() == 0
    assert router.lines[-1] == "router: ended"
    assert not any("warning" in line for line in router.lines)


def test_beyond_this_machine_it_warns_each_time_that_it_is_insecure():
    with on(None, "router", "--listen", "tcp/0.0.0.0:0", "--connect", "tcp/127.0.0.1:1", "--insecure") as router:
        router.said("warning: insecure")
        router.said("listens at")
        assert router.stop() == 0


def test_the_settings_for_another_router_are_what_it_would_use_itself(certs, monkeypatch, capsys):
    words = "router", *TLS, "--certs", certs, "--name", "gate2", "--revoked", "nobody", "--print"
    code, out, errors = called(monkeypatch, capsys, *words)
    assert (code, errors) == (0, "")
    settings = json.loads(out)
    assert zenoh.Config.from_json5(out).get_json("mode") == '"router"'
    tls = settings["transport"]["link"]["tls"]
    assert (tls["enable_mtls"], tls["listen_certificate"]) == (True, str(certs / "gate2.pem"))
    assert settings["transport"]["link"]["protocols"] == ["tls"]
    assert settings["access_control"]["default_permission"] == "deny"
    assert {of["id"] for of in settings["access_control"]["subjects"]} == {"r1", "gate", "gate2", "world"}


@pytest.mark.parametrize(
    "words",
    [
        ("--listen", "tcp/0.0.0.0:7447", "--connect", "tcp/127.0.0.1:1"),
        (*TLS,),
        ("--listen", "tls/nowhere", "--connect", "tcp/127.0.0.1:1"),
        (*TCP, "--runner", "r1"),
        (*TCP, "--certs", "none"),
        (*TCP, "--name", "gate"),
        ("--listen", "unixsock-stream//nowhere/at/all", "--connect", "tcp/127.0.0.1:1"),
    ],
)
def test_a_bad_call_is_one_line(words, monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "router", *words)
    assert (code, out) == (2, "")
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1


def test_which_of_several_certificates_must_be_said(certs, monkeypatch, capsys):
    code, _, errors = called(monkeypatch, capsys, "router", *TLS, "--certs", certs)
    assert code == 2
    assert "gate, gate2" in errors


def test_names_can_be_told_without_a_register(certs, monkeypatch, capsys):
    files = "--ca", certs / "ca.pem", "--certificate", certs / "gate.pem", "--key", certs / "gate.key"
    names = "--runner", "r1", "--router", "gate2", "--world", "lab"
    _, out, _ = called(monkeypatch, capsys, "router", *TLS, *files, *names, "--print")
    assert {of["id"] for of in json.loads(out)["access_control"]["subjects"]} == {"r1", "gate2", "lab"}
