"""Dates of certificates: UTC, to the second, as they stand in a certificate."""

from datetime import UTC, datetime, timedelta

from swarmwire.comms.clock import NS_PER_S, SCALED_FROM_NS, DatedClock
from swarmwire.comms.errors import BadInput

DAY = timedelta(days=1)
_FORM = "%Y-%m-%dT%H:%M:%SZ"
_CODE_IS_OF = datetime.fromtimestamp(SCALED_FROM_NS // NS_PER_S, UTC)


def date_now(clock: DatedClock) -> datetime:
    """The date that the clock shows; BadInput if it was never set, for it would stand in certificates."""
    now = datetime.fromtimestamp(clock.utc_ns() // NS_PER_S, UTC)
    if now < _CODE_IS_OF:
        raise BadInput("the clock of this machine", "", f"shows {text_of(now)}: set it first")
    return now


def text_of(date: datetime) -> str:
    """A date as 2026-11-21T03:04:05Z."""
    return date.strftime(_FORM)


def date_of(text: str) -> datetime:
    """The date in such a text; ValueError if it is none."""
    return datetime.strptime(text, _FORM).replace(tzinfo=UTC)
