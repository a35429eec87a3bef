"""Presets that reach to a fixed distance: textbooks' models, and the range and bearing of simulated robots."""

from swarmwire.comms.air.presets.preset import Preset

DISKS: dict[str, Preset] = {
    "ideal": Preset(
        "reaches everywhere, loses nothing, takes next to no time",
        "what abstract swarm models assume",
        {"model": "disk", "range_m": 10_000.0, "line_of_sight": False, "bit_rate_bps": 10**9},
    ),
    "disk": Preset("reaches 2 m, up to the next obstacle", "unit disk graphs", {"model": "disk", "range_m": 2.0}),
    "bernoulli": Preset(
        "a disk that loses every tenth packet",
        "the independent losses of textbooks",
        {"model": "disk", "range_m": 2.0, "loss": 0.1},
    ),
    "gilbert": Preset(
        "a disk whose links fail for half a second in ten",
        "E. N. Gilbert, Bell Syst. Tech. J. 39, 1960",
        {"model": "disk", "range_m": 2.0, "bursts": {"bad_s": 0.5, "good_s": 10.0}},
    ),
    "argos-rab": Preset(
        "ARGoS's range and bearing of the foot-bot: 3 m in line of sight, 10 bytes, from step to step",
        "ARGoS 3, ci_range_and_bearing, the foot-bot's entity, and rab_medium for what blocks",
        {
            "model": "disk",
            "range_m": 3.0,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 10,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "gives": {"range": {}, "bearing": {}},
        },
    ),
    "infrared-epuck": Preset(
        "ARGoS's range and bearing of the e-puck: 0.8 m in line of sight, 2 bytes beside the tag",
        "ARGoS 3, the e-puck's entity, and rab_medium for what blocks",
        {
            "model": "disk",
            "range_m": 0.8,
            "line_of_sight": True,
            "bodies_block": True,
            "max_payload_bytes": 4,
            "bit_rate_bps": 10**9,
            "send_offset": "tick",
            "gives": {"range": {}, "bearing": {}},
        },
    ),
}
