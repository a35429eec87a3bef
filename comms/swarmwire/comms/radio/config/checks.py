"""Checks of the scenario table `[radio]` over several keys: an error names the key that contradicts another."""

from dataclasses import replace
from ipaddress import IPv4Network

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.antennas import check_pattern
from swarmwire.comms.radio.config.impairments import refuse_negative
from swarmwire.comms.radio.config.lora import refuse_unfit_lora
from swarmwire.comms.radio.config.phy import Access, Fading, ReceiverNoise, Reception, refuse_unfit
from swarmwire.comms.radio.config.radio import Interface, Radio
from swarmwire.comms.radio.timing import DSSS_RATES_BPS, ESB, ESB_RATES_BPS, HT_BITS_PER_SYMBOL, OFDM_BITS_PER_SYMBOL

MIN_MTU_BYTES = 68  # IPv4 (RFC 791)
PHY_KEYS = ("lora", "antenna", "shadowing", "walls", "bodies", "fading", "noise", "reception", "access", "advertising")
MODEL_KEYS = {"log_distance": "log-distance", "two_ray": "two-ray", "itu_indoor": "itu-indoor"}
OFDM_MODELS = ("802.11ag", "802.11ag-nist")
RECEPTIONS = {  # besides threshold and table
    "802.11a": OFDM_MODELS,
    "802.11b": ("802.11b",),
    "802.11g": OFDM_MODELS,
    "802.11n": OFDM_MODELS,
    "esb": (),
}
ACCESS_KEYS = {  # methods of keys of [radio.access] that only some have
    "cca_threshold_dbm": ("csma-802154", "dcf"),
    "max_retries": ("csma-802154", "dcf", "esb"),
    "cca_sensitivity_dbm": ("dcf",),
    "cca_time_s": ("dcf",),
    "station": ("esb",),
    "host_delay_s": ("esb",),
    "safelink": ("esb",),
}
RATES_BPS = {
    "802.11a": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11b": DSSS_RATES_BPS,
    "802.11g": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11n": tuple(HT_BITS_PER_SYMBOL),
    "esb": ESB_RATES_BPS,
}


def check_radio(radio: Radio, where: str) -> None:
    """Raise BadInput for the first contradiction in a scenario's `[radio]`."""
    for name, model in MODEL_KEYS.items():
        if getattr(radio, name) is not None and radio.model != model:
            raise BadInput(where, f"radio.{name}", f'expected model = "{model}" with it, got "{radio.model}"')
    if radio.is_phy:
        _check_phy(radio, where)
    else:
        _check_unit_disk(radio, where)
    if radio.bursts is not None and radio.bursts.loss_bad < radio.bursts.loss_good:
        expected = f"expected at least loss_good, {radio.bursts.loss_good:g}; got {radio.bursts.loss_bad:g}"
        raise BadInput(where, "radio.bursts.loss_bad", expected)
    if radio.delays is not None:
        refuse_negative(radio.delays, where, "radio.delays")
    rates_bps = RATES_BPS.get(radio.frame, (radio.bit_rate_bps,))
    if radio.bit_rate_bps not in rates_bps:
        listed = ", ".join(str(rate_bps) for rate_bps in rates_bps)
        raise BadInput(where, "radio.bit_rate_bps", f"{radio.frame} has {listed}; got {radio.bit_rate_bps} bit/s")
    if radio.is_phy:
        _check_fits(radio, where)
    _check_lora(radio, where)
    if radio.interface is not None:
        _check_interface(radio, radio.interface, where)


def _check_lora(radio: Radio, where: str) -> None:
    lora = radio.lora_or_none
    if lora is None:
        if radio.lora is not None:
            raise BadInput(where, "radio.lora", f'expected frame = "lora" with it, got "{radio.frame}"')
        return
    if not radio.is_phy:
        raise BadInput(where, "radio.frame", 'expected a model with a PHY for "lora": a unit disk has no modulation')
    if radio.bit_rate_bps != Radio.bit_rate_bps:
        raise BadInput(where, "radio.bit_rate_bps", 'expected none for frame = "lora": radio.lora determines it')
    if radio.reception is not None:
        raise BadInput(where, "radio.reception", 'expected none for frame = "lora": radio.lora determines it')
    if radio.noise is not None and radio.noise.bandwidth_hz != ReceiverNoise.bandwidth_hz:
        raise BadInput(where, "radio.noise.bandwidth_hz", "expected none: radio.lora.bandwidth_hz determines it")
    refuse_unfit_lora(lora, radio.overhead_bytes, radio.max_payload_bytes, where)


def check_spreading(radio: Radio, spreading_factor: int, where: str, key: str) -> None:
    """Raise BadInput if robots cannot have this spreading factor; `key` is that of their radio."""
    lora = radio.lora_or_none
    if lora is None:
        raise BadInput(where, f"{key}.spreading_factor", f'expected frame = "lora" with it, got "{radio.frame}"')
    if radio.access_or_default.method == "cad" and spreading_factor != lora.spreading_factor:
        expected = f"expected {lora.spreading_factor}, that of the radio, with access method cad"
        raise BadInput(where, f"{key}.spreading_factor", f"{expected}; got {spreading_factor}")
    lora = replace(lora, spreading_factor=spreading_factor)
    refuse_unfit_lora(lora, radio.overhead_bytes, radio.max_payload_bytes, where)


def _check_interface(radio: Radio, interface: Interface, where: str) -> None:
    try:
        network = IPv4Network(interface.network)
        if network.is_loopback or network.is_multicast:
            raise ValueError(f"{network} has no addresses of hosts")
    except ValueError as error:
        expected = f"expected an IPv4 network such as 10.77.0.0/16: {error}"
        raise BadInput(where, "radio.interface.network", expected) from None
    if radio.mtu_bytes < MIN_MTU_BYTES:
        least = radio.max_payload_bytes + MIN_MTU_BYTES - radio.mtu_bytes
        expected = f"expected at least {least} for an interface: IPv4 needs {MIN_MTU_BYTES} bytes in a frame"
        raise BadInput(where, "radio.max_payload_bytes", f"{expected}; got {radio.max_payload_bytes}")


def unfit_for_torus(radio: Radio) -> str | None:
    """Return the key that a torus excludes, if any: only the unit disk computes distances across the seam."""
    return "model" if radio.is_phy else "bodies_block" if radio.bodies_block else None


def _check_unit_disk(radio: Radio, where: str) -> None:
    if radio.range_m is None:
        raise BadInput(
            where, "radio.range_m", "is missing; expected a number above 0 (m): the unit disk requires a range"
        )
    for name in PHY_KEYS:
        if getattr(radio, name) is not None:
            raise BadInput(where, f"radio.{name}", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.measures.rssi is not None:
        raise BadInput(where, "radio.measures.rssi", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.cut_off_db != Radio.cut_off_db:
        raise BadInput(where, "radio.cut_off_db", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.queue_lifetime_s is not None:
        raise BadInput(
            where, "radio.queue_lifetime_s", "expected a model with a PHY: a unit disk has no lifetime in queues"
        )


def _check_phy(radio: Radio, where: str) -> None:
    refuse_unfit(radio.reception_or_default, radio.bit_rate_bps, where, "radio.reception")
    check_pattern(radio.antenna_or_default.pattern, where, "radio.antenna.pattern")
    if radio.bodies_block:
        raise BadInput(where, "radio.bodies_block", "expected the model unit disk with it; a PHY has radio.bodies")
    if radio.walls is not None and radio.needs_line_of_sight:
        raise BadInput(where, "radio.walls", "expected no line_of_sight with it: obstacles either block or weaken")
    _check_access(radio, where)


def _check_access(radio: Radio, where: str) -> None:
    method, advertising = radio.access_or_default.method, radio.advertising
    if advertising is not None and method != "advertising":
        raise BadInput(where, "radio.advertising", f'expected access.method = "advertising" with it, got "{method}"')
    if advertising is not None and (advertising.scan_window_s or 0.0) > advertising.scan_interval_s:
        expected = f"expected at most scan_interval_s, {advertising.scan_interval_s:g}"
        raise BadInput(where, "radio.advertising.scan_window_s", f"{expected}; got {advertising.scan_window_s:g}")
    if method == "dcf" and not radio.frame.startswith("802.11"):
        raise BadInput(where, "radio.access.method", 'expected a frame of IEEE 802.11 for "dcf", such as 802.11b')
    if method != "dcf" and radio.frame == "802.11n":
        raise BadInput(where, "radio.access.method", f'expected "dcf" for frames of 802.11n, got "{method}"')
    if method in ("csma-802154", "advertising") and radio.frame != "plain":
        raise BadInput(where, "radio.access.method", f'expected frame = "plain" for "{method}", got {radio.frame}')
    if (method == "esb") != (radio.frame == "esb"):
        raise BadInput(where, "radio.access.method", f'expected "esb" with frame = "esb" alone; got {method}')
    if method == "esb" and not radio.access_or_default.acknowledged:
        raise BadInput(where, "radio.access.acknowledged", "expected true with method esb: an answer is one")
    if method == "esb" and radio.max_payload_bytes > ESB.max_payload_octets:
        expected = f"expected at most {ESB.max_payload_octets} with frames of esb; got {radio.max_payload_bytes}"
        raise BadInput(where, "radio.max_payload_bytes", expected)
    if method == "cad" and radio.frame != "lora":
        raise BadInput(where, "radio.access.method", f'expected frame = "lora" for "cad", got {radio.frame}')


def _check_fits(radio: Radio, where: str) -> None:
    """Raise BadInput for a key that the chosen access, reception, frame or fading does not use."""
    access, reception, fading = radio.access_or_default, radio.reception_or_default, radio.fading
    for name, methods in ACCESS_KEYS.items():
        if getattr(access, name) != getattr(Access, name) and access.method not in methods:
            expected = f"expected method {' or '.join(methods)} with it"
            raise BadInput(where, f"radio.access.{name}", f'{expected}, got "{access.method}"')
    max_retries = 15 if access.method == "esb" else 7
    if (access.max_retries or 0) > max_retries:
        expected = f"expected at most {max_retries} with method {access.method}; got {access.max_retries}"
        raise BadInput(where, "radio.access.max_retries", expected)
    for name in ("aggregation_bytes", "rts_threshold_bytes", "rate_control"):
        if getattr(access, name) != getattr(Access, name) and radio.frame != "802.11n":
            raise BadInput(where, f"radio.access.{name}", f'expected frame = "802.11n" with it, got "{radio.frame}"')
    fits = ("threshold", "table", *RECEPTIONS.get(radio.frame, (reception.model,)))
    if reception.model not in fits:
        expected = f"expected one of {', '.join(fits)} for frames of {radio.frame}; got {reception.model}"
        raise BadInput(where, "radio.reception.model", expected)
    conditional = {
        "reception.table": (reception.table is not None, reception.model, "table"),
        "reception.min_sinr_db": (reception.min_sinr_db != Reception.min_sinr_db, reception.model, "threshold"),
    }
    if fading is not None:
        conditional["fading.k"] = fading.k != Fading.k, fading.distribution, "rician"
        conditional["fading.m"] = fading.m != Fading.m, fading.distribution, "nakagami"
    for key, (is_set, chosen, needed) in conditional.items():
        if is_set and chosen != needed:
            raise BadInput(where, f"radio.{key}", f'expected "{needed}" with it, got "{chosen}"')
