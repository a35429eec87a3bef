"""Presets of what is no radio: infrared light, and sound in water.

Sound is told in dBm of acoustic power: a level in dB re 1 uPa, less 140.8 dB, is the power through a sphere of 1 m.
"""

from swarmwire.comms.air.presets.preset import Preset

OTHER_MEDIA: dict[str, Preset] = {
    "kilobot": Preset(
        "the Kilobot's infrared: 0.1 m, 9 bytes beside the tag, 30 kbit/s, carrier sense, distances to 2 mm",
        "M. Rubenstein et al., ICRA 2012; kilolib, message.h",
        {
            "model": "log-distance",
            "range_m": 0.1,
            "line_of_sight": True,
            "bit_rate_bps": 30_000,
            "overhead_bytes": 1,  # the tag's two bytes stand for the type and half of the checksum
            "max_payload_bytes": 11,
            "queue_limit": 1,
            "log_distance": {"reference_loss_db": 40.0},
            "reception": {"model": "threshold", "least_sinr_db": 6.0, "preamble_sinr_db": 6.0},
            "access": {"method": "csma-802154", "acknowledged": False},
            "gives": {"range": {"noise_m": 0.002}},
        },
        "messages that overlap are lost; carrier sense is that of IEEE 802.15.4, which gives up after 5 tries, where "
        "Kilobots go on trying; strength does not fall with distance, and its dBm tell nothing",
    ),
    "acoustic": Preset(
        "a small acoustic modem in the sea: 24 to 32 kHz, 640 bit/s, 168 dB re 1 uPa at 1 m (27.2 dBm), 1500 m/s",
        "Newcastle University, nanomodem v3 (USMART, 2018; Sherlock et al., Electronics 11, 2022: right from -4.5 dB); "
        "absorption: Thorp; noise: Coates, in M. Stojanovic, ACM MC2R 11, 2007",
        {
            "model": "log-distance",
            "frequency_hz": 28e3,
            "propagation_mps": 1500.0,
            "bit_rate_bps": 640,
            "overhead_bytes": 24,  # 64 bytes then take 1.1 s, the 463 bit/s of the data sheet
            "max_payload_bytes": 64,
            "log_distance": {"exponent": 2.0, "reference_loss_db": 0.0, "absorption_db_per_m": 0.0074},
            "antenna": {"power_dbm": 27.2},
            "noise": {"bandwidth_hz": 8e3, "figure_db": 70.8},  # 37.6 dB re 1 uPa in 1 Hz
            "reception": {"model": "threshold", "least_sinr_db": -4.5, "preamble_sinr_db": -4.5},
            "access": {"method": "aloha"},
        },
        "spherical spreading with absorption and the noise of 5 m/s of wind, without echoes, layers and Doppler shift; "
        "of two frames as strong the first survives, other frames being noise to it; which overlap is decided by when "
        "they were sent, whatever the distance: only what is heard is late",
    ),
}
