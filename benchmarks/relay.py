"""Topics over the radio: the share of maps that ten robots get of one another, and what it costs on air.

    python -m benchmarks.relay

Prints the table of docs/ros2-radio.md. Each robot sends a map of 4,000 bytes a second, at a moment of its own, over
the preset wifi-a-6M. The relay is that of a run; nodes, and zenoh, are left out.
"""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.protocols.ros2.relay import RelayedTopic, RelayPacket, RobotRelay
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.world.loop import Loop
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World

ROBOTS, RATE_HZ, PERIOD_S, MESSAGE_BYTES = 10, 10, 1, 4000
RETRY_AFTER_S, RETRIES = 0.3, 3  # the defaults of [ros2.relay]
LOSSES = (0.0, 0.1, 0.3)
SILENCE_S = 5  # at the end, in which no maps are sent


@dataclass(frozen=True)
class Delivery:
    """Delivered maps and their cost."""

    delivered: float  # share of intended receptions
    bytes_per_map: float  # payloads that the radios were to send
    parts: int  # packets of a map


class RelayAgents:
    """The agent backend of robots that send maps through their relays."""

    def __init__(self, topic: RelayedTopic, max_payload_bytes: int, sending_s: int) -> None:
        self.relays = [
            RobotRelay([_without(topic, robot)], max_payload_bytes, to_ns(RETRY_AFTER_S), RETRIES)
            for robot in range(ROBOTS)
        ]
        self._end_tick, self.bytes = sending_s * RATE_HZ, 0

    def start(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def counts(self) -> dict[str, int]:
        """Return none."""
        return {}

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Pass on received packets, and send the map of the robot whose turn it is."""
        now_ns = to_ns(tick / RATE_HZ)
        for receiver, sender, payload in zip(received.receiver, received.sender_index, received.payload, strict=True):
            self.relays[int(receiver)].receive(int(sender), received.payloads.row(payload), now_ns)
        robot = tick % (PERIOD_S * RATE_HZ)
        if robot < ROBOTS and tick < self._end_tick:
            self.relays[robot].send(0, bytes(MESSAGE_BYTES))
        queued = [(row, packet) for row, relay in enumerate(self.relays) for packet in _packets(relay, now_ns)]
        self.bytes += sum(len(packet.payload) for _, packet in queued)
        sent = SentPackets(
            np.array([row for row, _ in queued], np.int64),
            np.array([packet.to for _, packet in queued], np.int64),
            Payloads.from_rows([packet.payload for _, packet in queued]),
        )
        still = np.zeros(ROBOTS)
        return Actions(np.arange(ROBOTS), still > 0.0, still, still, still, sent)


def delivery(loss: float, *, reliable: bool, unicast: bool = False, sending_s: int = 60, seed: int = 1) -> Delivery:
    """Return the delivery of maps that are sent for `sending_s`; with `unicast`, to each other robot by itself."""
    scenario = scenario_from(
        {
            "format": 1,
            "name": "maps",
            "duration_s": float(sending_s + SILENCE_S),
            "arena": {"size_m": [20.0, 20.0]},
            "robots": {"mappers": {"body": "turtlebot4", "count": ROBOTS, "agent": "none:None"}},
            "radio": {"preset": "wifi-a-6M", "loss": loss},
        },
        "maps",
    )
    assert scenario.radio
    world = World(scenario, [seed], {"mappers": ()})
    topic = RelayedTopic(tuple(range(ROBOTS)) if unicast else (BROADCAST,), reliable)
    agents = RelayAgents(topic, scenario.radio.max_payload_bytes, sending_s)
    Loop(world, new_medium(scenario, world, traces=None), agents, observers=()).run((sending_s + SILENCE_S) * RATE_HZ)
    sent, received = (sum(relay.counts[count, 0] for relay in agents.relays) for count in ("messages", "received"))
    probe = RobotRelay([RelayedTopic((BROADCAST,), False)], scenario.radio.max_payload_bytes, 1, 1)
    probe.send(0, bytes(MESSAGE_BYTES))
    return Delivery(received / (sent * (ROBOTS - 1)), agents.bytes / sent, len(probe.pop_packets()))


def _without(topic: RelayedTopic, robot: int) -> RelayedTopic:
    return topic._replace(to=tuple(receiver for receiver in topic.to if receiver != robot))


def _packets(relay: RobotRelay, now_ns: int) -> list[RelayPacket]:
    relay.follow(now_ns)
    return relay.pop_packets()


def main() -> None:
    """Print the table."""
    print("| loss | (1 - loss)^parts | best effort | reliable | to each robot | reliable, to each |")
    print("| --- | --- | --- | --- | --- | --- |")
    for loss in LOSSES:
        ways = [(reliable, unicast) for unicast in (False, True) for reliable in (False, True)]
        deliveries = [delivery(loss, reliable=reliable, unicast=unicast) for reliable, unicast in ways]
        cells = [f"{100 * result.delivered:.1f} %, {result.bytes_per_map / 1000:.1f} kB" for result in deliveries]
        print(f"| {loss:.0%} | {100 * (1 - loss) ** deliveries[0].parts:.1f} % | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
