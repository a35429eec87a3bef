"""How responses, parameters and values are called in tables and figures."""

from swarmwire.metrics.campaign.about import Value
from swarmwire.metrics.campaign.point_values import value_text
from swarmwire.metrics.campaign.response import Response

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


def response_title(response: Response) -> str:
    """What a response is, in words, with its unit: "aggregation time in s"."""
    if response.column in _KNOWN:
        return _KNOWN[response.column]
    name, _, ending = response.column.rpartition(".")
    if ending not in _ENDINGS or not name:
        name, ending = response.column, ""
    name = name.removesuffix(f"_{response.unit}") if response.unit else name
    words = name.replace("_", " ")
    unit = f" in {response.unit}" if response.unit else ""
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
