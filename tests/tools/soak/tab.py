"""A client of the page of a run in place of a browser tab: reads news and status until the end."""

import json
import re
import sys
from pathlib import Path
from urllib.request import ProxyHandler, build_opener

from tests.support.clocks import until

OPEN = build_opener(ProxyHandler({}))  # no proxy for this machine


def addresses(log: Path) -> list[str]:
    """Addresses that a page has printed so far."""
    return re.findall(r"open (http://127\.0\.0\.1:\d+/\S+/) in a browser", log.read_text() if log.exists() else "")


def main(log: Path) -> None:
    """Follow the page whose newest address is in this log."""
    address = until(lambda: addresses(log))[-1]
    OPEN.open(f"{address}status", timeout=60).read()
    with OPEN.open(f"{address}news", timeout=60) as news:
        for line in news:
            if line.startswith(b"data:") and b'"state"' in line and json.loads(line[5:]).get("state") == "over":
                break
    print("the run is over", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
