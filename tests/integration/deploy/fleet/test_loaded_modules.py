"""Commands for robots and certificates load no simulator, and no library for numbers or tables."""

import json

from tests.integration.deploy.test_loaded_modules import SIMULATOR, loaded_by

PARTS = {f"swarmwire.{part}" for part in ("comms.radio", "deploy.campaigns", "deploy.runs", "metrics", "world")}


def modules_of(*commands: list[object]) -> set[str]:
    """The modules that a process has loaded after these commands."""
    return loaded_by("\n".join(f"call(*{json.dumps([*map(str, command)])})" for command in commands))


def test_commands_for_certificates_load_no_simulator(fleet, tmp_path):
    fleet.add("flock-0")
    folder = tmp_path / "ca"
    issue = ["certs", "issue", folder, "--fleet", fleet.file]
    modules = modules_of(
        ["certs", "init", folder], issue, ["certs", "list", folder], ["certs", "revoke", folder, "flock-0"]
    )
    assert not modules & {*SIMULATOR, *PARTS, "asyncssh"}
    assert "flock-0.pem" in {path.name for path in folder.iterdir()}


def test_commands_for_units_of_robots_load_no_simulator(fleet):
    fleet.servers.close(fleet.add("flock-0"))
    modules = modules_of(*(["robots", name, fleet.file] for name in ("status", "start", "stop", "rollback", "logs")))
    assert not modules & {*SIMULATOR, *PARTS}
    assert "asyncssh" in modules
