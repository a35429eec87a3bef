"""A clock whose date a test sets."""

from datetime import datetime

from swarmwire.comms.clock import NS_PER_S
from swarmwire.deploy.certificates.register import DAY
from tests.support.clocks import FakeClock


class DatedFakeClock(FakeClock):
    """A clock that shows a date until it is told to show another."""

    def __init__(self, date: str) -> None:
        super().__init__()
        self.date = datetime.fromisoformat(date)

    def utc_ns(self) -> int:
        return round(self.date.timestamp()) * NS_PER_S

    def pass_days(self, days: int) -> None:
        self.date += days * DAY
