"""How outcomes, parameters and values are called in tables and figures."""

from swarmwire.metrics.campaign.about import Value
from swarmwire.metrics.campaign.outcome import Outcome
from swarmwire.metrics.campaign.point_values import value_text

_ENDINGS = {
    "final": " at the end",
    "mean": ", mean over the run",
    "min": ", least in the run",
    "max": ", greatest in the run",
}
_KNOWN = {
    "radio.pdr": "delivery ratio (PDR), of intended receivers",
    "radio.link_pdr": "delivery ratio of links (link PDR)",
    "stop_time_s": "time until it stopped in s",
    "radio.sent": "packets sent",
    "radio.intended": "receivers meant",
    "radio.in_range": "receivers in range",
}


def outcome_title(outcome: Outcome) -> str:
    """What an outcome is, in words, with its unit: "aggregation time in s"."""
    if outcome.column in _KNOWN:
        return _KNOWN[outcome.column]
    name, _, ending = outcome.column.rpartition(".")
    if ending not in _ENDINGS or not name:
        name, ending = outcome.column, ""
    name = name.removesuffix(f"_{outcome.unit}") if outcome.unit else name
    words = name.replace("_", " ")
    unit = f" in {outcome.unit}" if outcome.unit else ""
    return f"{words}{unit}{_ENDINGS[ending]}" if ending else f"{words}{unit}"


def sentence(text: str) -> str:
    """The text with its first letter large."""
    return text[:1].upper() + text[1:]


def short_value(value: Value) -> str:
    """A parameter's value; six digits of a number that need not be whole."""
    return value_text(value, 6)


def listed(words: list[str]) -> str:
    """`a, b and c`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1]))) if words else ""
