"""Robots that join existing network namespaces: programs there use the radio, and nothing is left of a run."""

import os
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from swarmwire.deploy import Simulation, run
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.clocks import until
from tests.support.deploy.interfaces import DISK, STILL, line, needs_interfaces, needs_program, running, with_program
from tests.support.deploy.namespaces import ExistingNamespace, container_engine, named_namespace, process_namespace
from tests.support.deploy.runs import swarmwire
from tests.support.refusals import refused_input

pytestmark = [needs_interfaces, needs_program("ip", "nsenter", "ping", "unshare")]
EXAMPLE = Path(__file__).parents[4] / "examples" / "interfaces" / "containers.toml"
DATAGRAMS, DATA_BYTES, HEADERS_BYTES = 20, 700, 14 + 20 + 8  # Ethernet, IPv4, UDP
# Sends datagrams to all robots in range.
BROADCAST = f"""
import socket

sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
for _ in range({DATAGRAMS}):
    sender.sendto(bytes({DATA_BYTES}), ("10.77.255.255", 9))
"""
ROUTES = "224.0.0.0/4", "255.255.255.255"


@dataclass
class Places:
    """Existing namespaces of each kind; `container` is that of a process, too."""

    name: str
    named: ExistingNamespace
    process: ExistingNamespace
    container: ExistingNamespace


@pytest.fixture
def places(tmp_path, monkeypatch) -> Generator[Places]:
    with ExitStack() as stack:
        name, named = stack.enter_context(named_namespace())
        process, container = (stack.enter_context(process_namespace()) for _ in range(2))
        monkeypatch.setenv("PATH", container_engine(tmp_path / "bin", {"px4-3": container.pid, "stopped": 0}))
        yield Places(name, named, process, container)


def joined(**entries: str) -> tuple[str, str]:
    """The option with these entries; "_" in a robot's name is "-"."""
    table = ", ".join(f'{name.replace("_", "-")} = "{value}"' for name, value in entries.items())
    return "--set", f"radio.interface.join={{ {table} }}"


def reaches(namespace: ExistingNamespace, to: str) -> bool:
    return namespace.on("ping", "-c", "3", "-i", "0.1", "-W", "2", to).returncode == 0


@pytest.mark.parametrize("options", [(), ("--runners", "2")])
def test_joined_namespaces_talk_over_the_radio_and_have_their_own_devices_only_after_the_run(tmp_path, places, options):
    before = [namespace.state() for namespace in (places.named, places.process, places.container)]
    join = joined(line_1=f"netns:{places.name}", line_2=f"pid:{places.process.pid}", line_3="container:px4-{index}")
    with running(tmp_path, line(4) + DISK, "--packets", "all", *join, *options) as world:
        addresses = [world.address(f"line-{robot}") for robot in range(4)]
        assert world.on("line-0", "ping", "-c", "1", "-W", "2", "line-1").returncode == 0
        assert reaches(places.named, addresses[2])
        assert reaches(places.process, addresses[3])
        assert reaches(places.container, addresses[2])
        assert not reaches(places.container, addresses[1])
        assert "02:53:57:00:00:04" in places.container.ip("link", "show", "radio0")
        assert places.named.on(sys.executable, "-c", BROADCAST).returncode == 0
        assert reaches(places.named, addresses[0])  # what was broadcast before has arrived
        summary = world.end()
    assert [namespace.state() for namespace in (places.named, places.process, places.container)] == before
    packets = RunFolder(world.folder).packets()
    frames = packets.filter((packets["topic"] == "frame") & (packets["size_bytes"] == DATA_BYTES + HEADERS_BYTES))
    fates = Counter(zip(*(frames[name].to_list() for name in ("sender", "receiver", "fate")), strict=True))
    assert fates == {(1, 0, "received"): DATAGRAMS, (1, 2, "received"): DATAGRAMS}
    assert summary["interfaces"]["sent"] == summary["radio"]["sent"]
    assert summary["interfaces"]["delivered"] == summary["radio"]["fates"]["received"]
    assert summary["radio"]["fates"]["out_of_range"] > 0
    assert "interfaces_lost" not in summary["counts"]


@pytest.mark.parametrize("options", [(), ("--runners", "per-robot")])
def test_killed_world_leaves_existing_namespaces_as_they_were(tmp_path, places, options):
    before = places.named.state(), places.process.state()
    join = joined(line_0=f"netns:{places.name}", line_1=f"pid:{places.process.pid}")
    with running(tmp_path, line(2) + DISK, *join, *options) as world:
        assert reaches(places.named, world.address("line-1"))
        os.kill(world.process.pid, signal.SIGKILL)
        until(lambda: (places.named.state(), places.process.state()) == before)


def test_commands_and_programs_run_in_a_joined_namespace(tmp_path, places):
    script = 'hostname; ip -o -4 address show | cut -d" " -f2,7; exec sleep 1000'
    scenario = with_program(line(2), "sh", "-c", script) + DISK
    with running(tmp_path, scenario, *joined(line_1=f"netns:{places.name}")) as world:
        until(lambda: world.output("line-1") == "line-1\nown0 192.0.2.1/24\nradio0 10.77.0.2/16\n")
        done = swarmwire("exec", world.folder, "line-1", "--", "ping", "-c", "1", "-W", "2", "line-0")
        assert done.returncode == 0, done.stdout + done.stderr
        assert reaches(places.named, world.address("line-0"))
        world.end()
    assert swarmwire("verify", world.folder).returncode == 0


def test_example_of_containers_reaches_its_ground_station_also_by_ipv6(tmp_path, monkeypatch):
    with ExitStack() as stack:
        name, ground = stack.enter_context(named_namespace())
        drones = [stack.enter_context(process_namespace()) for _ in range(2)]
        for drone in drones:  # as docker starts containers without an IPv6 network
            for devices in ("all", "default"):
                drone.on("sh", "-c", f"echo 1 > /proc/sys/net/ipv6/conf/{devices}/disable_ipv6")
        pids = {f"px4-{index}": drone.pid for index, drone in enumerate(drones)}
        monkeypatch.setenv("PATH", container_engine(tmp_path / "bin", pids))
        options = "--set", f"radio.interface.join.ground-0=netns:{name}"
        agent = {"standing.py": (EXAMPLE.parent / "standing.py").read_text()}
        with running(tmp_path, EXAMPLE.read_text(), *options, files=agent) as world:
            assert [world.address(robot) for robot in world.robots] == ["10.77.0.1", "10.77.0.2", "10.77.0.3"]
            for drone, to in ((drones[0], "10.77.0.1"), (drones[1], "10.77.0.1"), (drones[0], "fd53:57::3")):
                assert reaches(drone, to), to
            assert reaches(ground, "fd53:57::3")
            assert swarmwire("ctl", "--run", world.folder, "kill", "drone-1").returncode == 0
            until(lambda: not reaches(ground, "10.77.0.3"))
            until(lambda: reaches(ground, "10.77.0.2"))
            world.end()


def test_robot_is_off_the_air_once_the_process_that_it_joined_ends_and_others_go_on(tmp_path, places):
    join = joined(line_1=f"pid:{places.process.pid}", line_2=f"netns:{places.name}")
    with running(tmp_path, line(3, 0.25) + DISK, *join) as world:
        assert reaches(places.named, world.address("line-1"))
        os.kill(places.process.pid, signal.SIGKILL)
        until(lambda: not reaches(places.named, world.address("line-1")))
        assert reaches(places.named, world.address("line-0"))
        late = world.on("line-1", "true")
        assert (late.returncode, late.stderr.startswith("error: cannot enter line-1: ")) == (125, True)
        summary = world.end()
    assert [(event["do"], *event["robots"]) for event in summary["events"]] == [("interface_lost", "line-1")]
    assert summary["counts"]["interfaces_lost"] == 1
    assert summary["counts"]["frames_refused_by_device"] > 0


def test_routes_to_groups_lead_to_the_radio_unless_a_namespace_has_a_default_route(tmp_path, places):
    places.process.ip("route", "add", "default", "via", "192.0.2.9")
    join = joined(line_0=f"netns:{places.name}", line_1=f"pid:{places.process.pid}")
    with running(tmp_path, line(2) + DISK, *join) as world:
        shown = [namespace.ip("route") for namespace in (places.named, places.process)]
        assert [all(f"{route} dev radio0" in routes for route in ROUTES) for routes in shown] == [True, False]
        assert "default via 192.0.2.9 dev own0" in shown[1]
        places.named.ip("link", "set", "radio0", "down")
        places.named.ip("link", "set", "radio0", "up")
        until(lambda: all(route in places.named.ip("route") for route in ROUTES))
        world.end()


def test_gateway_answers_in_a_joined_namespace_whose_lo_is_up(tmp_path, places):
    pytest.importorskip("rosbags", reason="needs the extra [ros2]")
    path = scenario_file(tmp_path, f'line-0 = "netns:{places.name}"')
    with refused_input(match="gateways: expected an address that robots have, and lo up in namespaces that they join"):
        run(path, realtime=1, gateways="ros2", overrides=["duration_s=1"])
    places.named.ip("link", "set", "lo", "up")
    hello = "import socket; socket.create_connection(('127.0.0.1', 7447), 20)"
    join = joined(line_0=f"netns:{places.name}")
    with running(tmp_path, line(1) + DISK, "--gateway", "ros2", *join) as world:
        assert places.named.on(sys.executable, "-c", hello).returncode == 0
        world.end()


def scenario_file(folder: Path, entries: str) -> Path:
    (folder / "still.py").write_text(STILL)
    path = folder / "scenario.toml"
    path.write_text(line(2) + DISK + f"[radio.interface]\njoin = {{ {entries} }}\n")
    return path


def refusal(folder: Path, entries: str, entry: str, expected: str) -> None:
    """Require that the run is refused before it begins, with this key and expectation."""
    path, out = scenario_file(folder, entries), folder / "out"
    assert Simulation(path).plan.static.robots == 2  # a scenario can be checked where its namespaces do not exist
    with refused_input(path, f"radio.interface.join.{entry}", re.escape(expected)):
        run(path, realtime=1, out=out, overrides=["duration_s=1"])
    assert not out.exists()


def test_namespaces_that_do_not_exist_are_refused_before_the_run(tmp_path, places):
    refusal(tmp_path, 'line-0 = "netns:none"', "line-0", "expected a network namespace in /run/netns")
    refusal(tmp_path, 'line-1 = "pid:4194305"', "line-1", "expected a running process of this machine")
    container = "expected a running container that docker or podman of this machine knows"
    unknown = f"{container} (Error: No such container: px4-0; Error: No such container: px4-0); got container:px4-0"
    refusal(tmp_path, 'line = "container:px4-{index}"', "line", unknown)
    refusal(tmp_path, 'line-0 = "container:stopped"', "line-0", f"{container} (it does not run; Error: No such")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", str(tmp_path / "none"))
        refusal(tmp_path, 'line-0 = "container:px4-3"', "line-0", "expected docker or podman on PATH")


def test_namespace_of_others_is_refused_without_the_rights_to_enter_it(tmp_path, places):
    path = scenario_file(tmp_path, f'line-0 = "netns:{places.name}"')
    run_command = [sys.executable, "-m", "swarmwire.deploy", "run", str(path), "--realtime", "1"]
    command = ["unshare", "--user", "--map-root-user", *run_command, "--out", str(tmp_path / "out")]
    unshared = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert unshared.returncode == 2
    assert f"expected rights to enter the network namespace: run as root; got netns:{places.name}" in unshared.stderr


def test_namespace_of_two_robots_or_with_the_device_or_the_network_is_refused(tmp_path, places):
    pid = places.process.pid
    shared = f'line-0 = "pid:{pid}", line-1 = "container:px4"'
    engine = container_engine(tmp_path / "podman", {"px4": pid}, "podman")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", engine)
        refusal(tmp_path, shared, "line-1", "expected a network namespace for each robot: line-0 and line-1 share one")
    places.named.ip("tuntap", "add", "radio0", "mode", "tap")
    without = "expected a network namespace without a device radio0"
    refusal(tmp_path, f'line-0 = "netns:{places.name}"', "line-0", without)
    assert "radio0" in places.named.ip("link")
    places.process.ip("address", "add", "10.77.3.1/24", "dev", "own0")
    path = scenario_file(tmp_path, f'line-0 = "pid:{pid}"')
    expected = rf"expected a network that pid:{pid} does not use: own0 has 10\.77\.3\.0/24"
    with refused_input(path, "radio.interface.network", expected):
        run(path, realtime=1, overrides=["duration_s=1"])
