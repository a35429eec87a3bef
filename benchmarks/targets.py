"""What is asked of each benchmark, and what it measures in a few words."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """A number to reach: at least so much, or at most."""

    value: float
    meaning: str
    at_most: bool = False

    def met_by(self, value: float) -> bool:
        """Whether a value is as good as asked."""
        return value <= self.value if self.at_most else value >= self.value


def most(value: float, meaning: str) -> Target:
    """A target to stay below."""
    return Target(value, meaning, at_most=True)


TARGETS = {
    "inprocess-1000-d1": Target(
        1_900_000,
        "1,000 foot-bots, 24 rays, diffusion at 0.05 m/s, 1 per square metre, 5 physics steps (pymunk: 250,000)",
    ),
    "inprocess-1000-d1-10steps": Target(
        1_650_000, "the same with 10 physics steps, ARGoS's default (ARGoS at its best: 77,000)"
    ),
    "inprocess-1000-d4": Target(1_400_000, "4 per square metre, 5 steps (ARGoS: 75,000)"),
    "inprocess-1000-d1-radio": Target(470_000, "d1 with a 10-byte broadcast of each robot and tick (ARGoS: 25,000)"),
    "inprocess-1000-d4-radio": Target(310_000, "d4 with a broadcast (ARGoS, where bodies block: 8,800)"),
    "inprocess-10000-d1": Target(1_850_000, "10,000 foot-bots (ARGoS: 63,000)"),
    "inprocess-100000-d1": Target(1.25, "100,000 foot-bots at 10 Hz"),
    "laser-1000": Target(14, "1,000 TurtleBots, 360 rays of 3.5 m at 5 Hz with noise"),
    "single-10": Target(800, "one run of 10 foot-bots"),
    "single-10-radio": Target(500, "the same with a broadcast of each robot and tick"),
    "replicas-100x10": Target(1_650_000, "100 arenas of 10 foot-bots side by side"),
    "wire-1000x2": Target(142_000, "`inprocess-1000-d1-radio`, its agents in 2 runner processes"),
    "learn-100x10": Target(
        405_000, "100 arenas of 10 e-pucks as an environment: physics, rays, broadcasts, observation, reward"
    ),
    "learn-1000x10": Target(520_000, "1,000 of them"),
    "start-1000": most(
        0.012, "from the call to the first tick of a world with a radio, kernels cached, imports left out"
    ),
    "agent-overhead-step": most(13, "what an `Agent` costs in a step beyond its own code, alone with nothing received"),
    "agent-overhead-packet": most(2.15, "and for each packet that it reads"),
    "record-cost": most(1.10, "`inprocess-1000-d1` for 600 ticks with its ticks and metrics recorded and joined"),
    "record-cost-size": most(8, "Parquet of that run"),
    "view-cost": most(15, "the same, recorded for the viewer; without a radio, so of a short tick"),
    "view-cost-size": most(16, "`run.rrd` of that run"),
    "view-cost-radio": most(15, "with the radio, 8.7 packets received per robot and tick"),
    "view-cost-radio-size": most(20, "`run.rrd` of that run"),
    "metrics-share": most(16, "what the metrics of every run cost of `inprocess-1000-d1`"),
    "metrics-share-radio": most(20, "the same, of `inprocess-1000-d1-radio`"),
    "radio-802154-1000": Target(
        20, "1,000 robots, 20 bytes, 29 in range, 802.15.4: shadowing, fading, CSMA, SINR to 10 dB below noise"
    ),
    "radio-802154-1000-threads": Target(32, "the same with two threads"),
    "radio-disk-1000": Target(250, "1,000 robots over a disk, 9 in range"),
    "radio-wifi-80": Target(105, "80 robots in one spot over `wifi-a-6M`, 128 bytes: 100 times ns-3's wheel"),
    "radio-wifi-80-standing": Target(185, "the same, of robots that stand"),
    "radio-scaling": most(1.5, "the first with 100, 1,000 and 10,000 robots: the dearest link over the cheapest"),
    "line-of-sight-9500": most(
        3.7, "a tick of the medium: 1,000 robots, 7,800 links within range of a unit disk, a map of 9,500 boxes"
    ),
    "campaign-1000x10": most(
        8, "1,000 runs of 10 robots x 600 ticks with radio and metrics, from the call to the table, on 2 cores"
    ),
    "processes-100": Target(8, "100 e-pucks that flock, each an `Agent` in plain Python in its own process"),
    "processes-100-start": most(0.53, "from the call to the first tick, imports left out"),
    "processes-100-uss": most(5, "memory that a runner does not share with others"),
    "processes-200": Target(5, "200 e-pucks that flock, each an `Agent` in plain Python, about 10 packets received"),
    "processes-1000": Target(1.0, "1,000 of them"),
    "processes-1000-start": most(2.9, "from the call to the first tick, imports left out"),
    "processes-1000-memory": most(4, "of world, agent host and runners together, as sum of their PSS"),
    "wire-over-floor": most(
        1.6,
        "a tick of `processes-200` over as many bytes to processes that only answer, plus the agents' own time",
    ),
    "realtime-50": most(
        1.5, "50 robots that relay, 2 runners, 1 ms subtick: 99 % of packets are handed over no later than so after due"
    ),
    "interfaces-disk": most(
        3, "20 robots that send 50 frames of 200 bytes a second: 99 % are delivered no later than so after due"
    ),
    "interfaces-disk-cpu": most(60, "CPU of the world for a frame, beyond that of the same run without interfaces"),
    "interfaces-wifi": most(2, "the same over `wifi-a-6M`"),
    "interfaces-wifi-cpu": most(60, "its CPU"),
    "interfaces-start-50": most(
        1.43, "50 robots with an interface and a program each, from the call to the first tick"
    ),
    "trace-1000": most(1.4, "reading a trace in Parquet: 1,000 robots, an hour, 10 samples a second"),
    "trace-1000-share": most(1.7, "its poses, of a tick over a disk, 9 in range"),
    "poses-udp-100": most(4.3, "processor of the world for poses of 100 robots at 50 Hz"),
    "poses-udp-use": most(
        1.3,
        "99 % of them are used no later after arrival, by the time of a radio with 1 ms sub-ticks",
    ),
    "tls-cost": most(
        1.15, "a lockstep tick of 40 e-pucks flocking, a process each, over mutual TLS with access control"
    ),
    "compile-world": most(20, "a machine's first run without a radio: processor time beyond that of the next"),
    "compile-disk": most(30, "with a disk radio"),
    "compile-signals": most(30, "with a PHY"),
    "robot-step": most(
        1, "a step on a robot, CPU time of its thread: e-puck2 over TCP, Flocking, own network, 5 received"
    ),
    "robot-step-memory": most(60, "the most memory that the process of such an agent held"),
    "robot-step-ros2": most(1, "the same on a TurtleBot behind a bridge of ROS 2"),
    "robot-step-ros2-memory": most(60, "the most memory of its process"),
    "deploy-20": most(5.3, "a new release to twenty hosts at once over OpenSSH, all on one machine, a trial run each"),
    "report-10000": most(8, "`swarmwire report` of 50 points x 200 seeds with 10 responses, from the call to its end"),
    "report-10000-memory": most(700, "the most memory that it held"),
}
