"""One robot's program: it sends a state, a map and commands by one middleware, and logs each message that arrives.

    python node.py udp|dds|dds-wifi|zenoh-peer|zenoh-client|zenoh-router|mqtt

Each robot sends a state of 200 bytes at 10 Hz to all, and the last robot a map of 20 kB each second to all. Robot 0
sends a command to one robot after the other, two a second, which must arrive: each middleware keeps it as well as it
can without a database. `$ROBOT_SCRATCH/sent.bin` has a RECORD for each message that was sent, `received.bin` for each
that arrived: `delivery.py` reads them. The middleware begins START_S after mesh.sh, when its modules are imported and
babeld has routes; the file `begun` has that time.
"""

# What cyclonedds and paho declare is incomplete.
# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false

import json
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from threading import Lock, Thread
from types import new_class
from typing import Any, NamedTuple, Protocol

STATE, MAP, COMMAND = b"s", b"m", b"c"
SIZES_BYTES = {STATE: 200, MAP: 20_000, COMMAND: 64}
PERIODS_S = {STATE: 0.1, MAP: 1.0, COMMAND: 0.5}
HEAD = struct.Struct("<cBBIq")  # kind, sender, receiver (ALL: each other robot), number, time of sending in ns
RECORD = struct.Struct("<qcBBIq")  # time of arrival, or again of sending, in ns, and a HEAD
ALL = 255
START_S = float(os.environ.get("START_S", "12"))  # from the start of mesh.sh to that of the middleware
PORT = 7500
UDP_PAUSE_S = 0.05  # between the copies of a map
MAX_COMMANDS = 1000  # that are kept for robots that are away


class Log:
    """A file to which whole records are appended, by any thread."""

    def __init__(self, path: Path) -> None:
        self._file, self._lock = path.open("ab", buffering=0), Lock()

    def add(self, at_ns: int, message: bytes) -> None:
        """Append the record of a message."""
        with self._lock:
            self._file.write(RECORD.pack(at_ns, *HEAD.unpack_from(message)))


class Team(NamedTuple):
    """The robots as one of them sees them, and what it calls with each message."""

    robot: int
    addresses: tuple[str, ...]  # by robot
    receive: Callable[[bytes], None]
    scratch: Path

    def others(self) -> list[int]:
        """Return the other robots."""
        return [robot for robot in range(len(self.addresses)) if robot != self.robot]


class Transport(Protocol):
    """A middleware on one robot."""

    def send(self, kind: bytes, receiver: int, message: bytes) -> None:
        """Send a message to one robot, or to ALL."""
        ...


class Udp:
    """A datagram to each receiver; IP cuts a map into fragments, and nothing is sent again."""

    def __init__(self, team: Team) -> None:
        self._team = team
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("", PORT))
        Thread(target=self._listen, daemon=True).start()

    def send(self, kind: bytes, receiver: int, message: bytes) -> None:
        """Send it; the copies of a map go one after the other, so that no queue overflows."""
        receivers = self._team.others() if receiver == ALL else [receiver]
        if kind == MAP:
            Thread(target=self._send, args=(message, receivers, UDP_PAUSE_S), daemon=True).start()
        else:
            self._send(message, receivers, 0.0)

    def _send(self, message: bytes, receivers: Sequence[int], pause_s: float) -> None:
        for robot in receivers:
            try:
                self._socket.sendto(message, socket.MSG_DONTWAIT, (self._team.addresses[robot], PORT))
            except OSError as error:  # no route: lost, as on the air
                print("not sent:", error, flush=True)
            time.sleep(pause_s)

    def _listen(self) -> None:
        while True:
            self._team.receive(self._socket.recv(65_535))


DDS_INTERFACE = '<Interfaces><NetworkInterface name="radio0"/></Interfaces>'
# Multicast for discovery alone, datagrams that IP need not cut, and peers by address, since multicast crosses one hop;
# without a limit of the participants on a robot, discovery tries a hundred ports of each.
DDS_WIFI = "<AllowMulticast>spdp</AllowMulticast><MaxMessageSize>1400B</MaxMessageSize>"
DDS_INDEX = "<ParticipantIndex>0</ParticipantIndex><MaxAutoParticipantIndex>0</MaxAutoParticipantIndex>"


class Dds:
    """Cyclone DDS: a state as sensor data, a map reliable, commands reliable and kept for robots that come back."""

    def __init__(self, team: Team, wifi: bool) -> None:
        peers = "".join(f'<Peer address="{team.addresses[robot]}"/>' for robot in team.others())
        discovery = f"<Discovery>{DDS_INDEX}<Peers>{peers}</Peers></Discovery>" if wifi else ""
        general = f"<General>{DDS_INTERFACE}{DDS_WIFI if wifi else ''}</General>"
        os.environ["CYCLONEDDS_URI"] = f"<CycloneDDS><Domain>{general}{discovery}</Domain></CycloneDDS>"
        from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        self._types = {kind: self._type(kind) for kind in SIZES_BYTES}
        reliable, latest = Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1)
        lasting = Policy.Durability.TransientLocal
        command = Qos(
            reliable, lasting, Policy.History.KeepAll, Policy.DurabilityService(
                cleanup_delay=0, history=Policy.History.KeepLast(MAX_COMMANDS), max_samples=-1, max_instances=-1,
                max_samples_per_instance=-1,
            ),
        )  # fmt: skip
        self._participant = DomainParticipant(0)
        arrivals = WaitSet(self._participant)
        self._writers: dict[tuple[bytes, int], Any] = {}
        self._readers: list[tuple[Any, Any]] = []  # with the condition that keeps them in `arrivals`
        sensor_data = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5))  # as in ROS 2, over all writers
        qualities = {STATE: sensor_data, MAP: Qos(reliable, latest), COMMAND: command}
        names = [(STATE, ALL), (MAP, ALL), *((COMMAND, robot) for robot in range(1, len(team.addresses)))]
        for kind, receiver in names:
            topic = Topic(self._participant, f"{kind.decode()}{receiver}", self._types[kind])
            if receiver in (ALL, team.robot):
                reader = DataReader(self._participant, topic, qos=qualities[kind])
                states = SampleState.NotRead | ViewState.Any | InstanceState.Any
                self._readers.append((reader, ReadCondition(reader, states)))
                arrivals.attach(self._readers[-1][1])
            if receiver == ALL or team.robot == 0:
                self._writers[kind, receiver] = DataWriter(self._participant, topic, qos=qualities[kind])

        Thread(target=self._listen, args=(arrivals, team.receive), daemon=True).start()

    def _listen(self, arrivals: Any, receive: Callable[[bytes], None]) -> None:
        """Pass on samples; a listener would wait for Python's lock, which a writer holds that waits for its readers."""
        from cyclonedds.util import duration

        while True:
            arrivals.wait(duration(seconds=1))
            for reader, _ in self._readers:
                for sample in reader.take(N=64):
                    if getattr(sample, "data", None) is not None:  # else: a writer that has gone
                        receive(bytes(sample.data))

    def send(self, kind: bytes, receiver: int, message: bytes) -> None:
        """Write it; a writer that waits for its readers for too long drops it."""
        from cyclonedds.core import DDSException

        try:
            self._writers[kind, receiver].write(self._types[kind](data=message))
        except DDSException as error:
            print("not sent:", error, flush=True)

    def _type(self, kind: bytes) -> Any:
        """Return the type of a kind's samples; an array takes bytes as they are, a sequence a list of numbers."""
        from dataclasses import dataclass

        from cyclonedds.idl import IdlStruct
        from cyclonedds.idl.types import array, uint8

        fields = {"data": array[uint8, SIZES_BYTES[kind]]}
        name = {STATE: "State", MAP: "Map", COMMAND: "Command"}[kind]
        return dataclass(
            new_class(name, (IdlStruct,), {"typename": name}, lambda body: body.update(__annotations__=fields))
        )


class Zenoh:
    """Zenoh over TCP: peers that scout, clients of a router on robot 0, or a router on each robot.

    Commands are kept and asked for again, by the advanced publisher and subscriber.
    """

    def __init__(self, team: Team, mode: str) -> None:
        import zenoh
        from zenoh import ext

        zenoh.init_log_from_env_or("warn")
        endpoints = [f"tcp/{address}:{PORT}" for address in team.addresses]
        listen = {"endpoints": [endpoints[team.robot]]}
        # All robots are on one machine, and large messages would pass by its memory instead of the radio.
        settings: dict[str, Any] = {"transport": {"shared_memory": {"enabled": False}}}
        settings["scouting"] = {"multicast": {"enabled": mode == "peer", "interface": "radio0"}}
        if mode == "peer":
            settings |= {"mode": "peer", "listen": listen}
        elif mode == "router" or team.robot == 0:
            connect = endpoints[: team.robot] if mode == "router" else []
            settings |= {"mode": "router", "listen": listen, "connect": {"endpoints": connect}}
        else:
            settings |= {"mode": "client", "connect": {"endpoints": endpoints[:1], "timeout_ms": -1}}
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))

        def receive(sample: Any) -> None:
            team.receive(sample.payload.to_bytes())

        drop, block = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
        weak, strong = zenoh.Reliability.BEST_EFFORT, zenoh.Reliability.RELIABLE
        declare = self._session.declare_publisher
        self._publishers: dict[tuple[bytes, int], Any] = {
            (STATE, ALL): declare("team/state", congestion_control=drop, reliability=weak),
            (MAP, ALL): declare("team/map", congestion_control=drop, reliability=strong),
        }
        self._subscribers = [self._session.declare_subscriber(key, receive) for key in ("team/state", "team/map")]
        for robot in team.others() if team.robot == 0 else ():
            self._publishers[COMMAND, robot] = ext.declare_advanced_publisher(
                self._session,
                f"team/command/{robot}",
                congestion_control=block,
                cache=ext.CacheConfig(MAX_COMMANDS),
                sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
                publisher_detection=True,
            )
        self._commands = ext.declare_advanced_subscriber(
            self._session,
            f"team/command/{team.robot}",
            receive,
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=MAX_COMMANDS),
            recovery=ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            subscriber_detection=True,
        )

    def send(self, kind: bytes, receiver: int, message: bytes) -> None:
        """Put it."""
        self._publishers[kind, receiver].put(message)


class Mqtt:
    """MQTT with a broker on robot 0: commands with quality 1 in sessions that the broker keeps, all else with 0."""

    def __init__(self, team: Team) -> None:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        if team.robot == 0:
            config = team.scratch / "mosquitto.conf"
            config.write_text(f"listener {PORT} 0.0.0.0\nallow_anonymous true\nuser root\nmax_queued_messages 0\n")
            subprocess.Popen(["mosquitto", "-c", str(config)])
        topics = [("team/state", 0), ("team/map", 0), (f"team/command/{team.robot}", 1)]
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=f"robot-{team.robot}", clean_session=False)
        self._client.on_connect = lambda client, *_: client.subscribe(topics)
        self._client.on_message = lambda _client, _data, message: team.receive(bytes(message.payload))
        self._client.reconnect_delay_set(1, 2)
        self._client.connect_async(team.addresses[0], PORT, keepalive=5)
        self._client.loop_start()

    def send(self, kind: bytes, receiver: int, message: bytes) -> None:
        """Publish it; without a connection, commands wait."""
        if kind == COMMAND:
            self._client.publish(f"team/command/{receiver}", message, qos=1)
        elif self._client.is_connected():
            self._client.publish("team/state" if kind == STATE else "team/map", message)


MODULES = {  # that take long to import, by the begin of a transport's name
    "dds": ("cyclonedds.core", "cyclonedds.domain", "cyclonedds.pub", "cyclonedds.sub", "cyclonedds.idl"),
    "zenoh": ("zenoh", "zenoh.ext"),
    "mqtt": ("paho.mqtt.client",),
}
TRANSPORTS: dict[str, Callable[[Team], Transport]] = {
    "udp": Udp,
    "dds": lambda team: Dds(team, wifi=False),
    "dds-wifi": lambda team: Dds(team, wifi=True),
    "zenoh-peer": lambda team: Zenoh(team, "peer"),
    "zenoh-client": lambda team: Zenoh(team, "client"),
    "zenoh-router": lambda team: Zenoh(team, "router"),
    "mqtt": Mqtt,
}


def team_addresses(hosts: str, robot: str) -> tuple[str, ...]:
    """Return the IPv4 addresses of a robot's group by index, from the text of /etc/hosts."""
    group = robot.rpartition("-")[0]
    lines = [line.split() for line in hosts.splitlines() if "." in line.partition(" ")[0]]
    names = {name: address for address, *aliases in lines for name in aliases if name.rpartition("-")[0] == group}
    return tuple(names[name] for name in sorted(names, key=lambda name: int(name.rpartition("-")[2])))


def schedule(robot: int, robots: int) -> Iterator[tuple[float, bytes, int]]:
    """Yield the time of each message in s from the start, its kind and its receiver, in order.

    Each robot has a phase of its own, so that they do not all send at once.
    """
    kinds = [STATE, *([MAP] if robot == robots - 1 else []), *([COMMAND] if robot == 0 else [])]
    counts = dict.fromkeys(kinds, 0)
    while True:
        times_s = {kind: (counts[kind] + robot / robots) * PERIODS_S[kind] for kind in kinds}
        kind = min(times_s, key=times_s.__getitem__)
        yield times_s[kind], kind, 1 + counts[kind] % (robots - 1) if kind == COMMAND else ALL
        counts[kind] += 1


def main(arguments: Sequence[str]) -> None:
    """Send and log until the run ends the program."""
    if len(arguments) != 1 or arguments[0] not in TRANSPORTS:
        raise SystemExit(f"expected one of {', '.join(TRANSPORTS)}; got {' '.join(arguments)!r}")
    scratch, robot = Path(os.environ["ROBOT_SCRATCH"]), int(os.environ["ROBOT_INDEX"])
    addresses = team_addresses(Path("/etc/hosts").read_text(), os.environ["ROBOT"])
    received, sent = Log(scratch / "received.bin"), Log(scratch / "sent.bin")
    for module in MODULES.get(arguments[0].partition("-")[0], ()):
        import_module(module)
    begin_ns = int((scratch / "started").read_text()) + int(START_S * 1e9)
    time.sleep(max(0.0, (begin_ns - time.time_ns()) / 1e9))
    (scratch / "begun").write_text(str(time.time_ns()))
    transport = TRANSPORTS[arguments[0]](
        Team(robot, addresses, lambda message: received.add(time.time_ns(), message), scratch)
    )
    for number, (at_s, kind, receiver) in enumerate(schedule(robot, len(addresses))):
        due_ns = begin_ns + int(at_s * 1e9)
        time.sleep(max(0.0, (due_ns - time.time_ns()) / 1e9))
        now_ns = time.time_ns()
        # The middleware was not open, or blocked: a robot sends its latest state, not those that it could not send.
        is_stale = kind != COMMAND and now_ns > due_ns + PERIODS_S[kind] * 1e9
        message = HEAD.pack(kind, robot, receiver, number, due_ns if is_stale else now_ns)
        sent.add(due_ns if is_stale else now_ns, message)
        if not is_stale:
            transport.send(kind, receiver, message.ljust(SIZES_BYTES[kind], b"\0"))


if __name__ == "__main__":
    main(sys.argv[1:])
