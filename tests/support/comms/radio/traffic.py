"""Random radios and traffic for laws that hold whatever is sent, and runs in which disruptions come and go."""

import numpy as np
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.packets import BROADCAST, SentPackets
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.truth import Obstacle
from tests.support.comms.radio.runs import RATE_HZ, Run, packets

RADIOS = st.builds(
    Radio,
    range_m=st.floats(0.1, 9.0),
    line_of_sight=st.booleans(),
    loss=st.sampled_from([0.0, 0.3, 1.0]),
    latency_s=st.sampled_from([0.0, 0.1, 0.25]),
    jitter_s=st.sampled_from([0.0, 0.02, 0.3]),
    bit_rate_bps=st.sampled_from([300, 2_000, 250_000]),
    overhead_bytes=st.integers(0, 20),
    max_payload_bytes=st.integers(10, 60),
    queue_limit=st.integers(0, 4),
    send_offset=st.sampled_from(["uniform", "tick", 0.0, 0.03, 0.25]),
)
OBSTACLES = [Obstacle("cylinder", 0.5, 0.5, radius_m=0.4), Obstacle("box", -1.0, -1.0, 0.3, size_m=(1.5, 0.4))]


def random_traffic(rng: np.random.Generator, arenas: int, robots: int) -> SentPackets:
    """Some robots send some packets, to all or to one, in any order."""
    k = int(rng.integers(0, 3 * robots))
    sender = rng.integers(0, arenas * robots, k)
    to = (sender + rng.integers(1, robots, k)) % robots
    return packets(sender, np.where(rng.random(k) < 0.6, BROADCAST, to), rng.integers(0, 70, k))


def run_disrupted(
    medium: RadioMedium, pose: FloatArray, sent: dict[int, SentPackets], now: dict[int, Disruption], ticks: int
) -> Run:
    """What is sent, and what holds from then on, by tick."""
    out, current = Run(medium), Disruption.none(len(pose))
    for tick in range(ticks):
        at_ns = tick_start_ns(tick, RATE_HZ)
        current = now.get(tick, current)
        out.news.append(medium.step(at_ns, pose, current))
        medium.send(at_ns, tick, sent.get(tick, SentPackets.none()))
    out.last = medium.end()
    return out
