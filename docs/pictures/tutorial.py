"""Makes the campaign of docs/tutorial-packet-loss.md as that page says, and takes its figures from the report.

`python -m docs.pictures.tutorial`
"""

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

DOCS = Path(__file__).parents[1]
PAGE = DOCS / "tutorial-packet-loss.md"
FIGURES = {  # of the report, and as what the page shows them
    "reached-stop_time_s-radio.loss": "tutorial-packet-loss-aligned",
    "response-stop_time_s-radio.loss": "tutorial-packet-loss",
    "survival-stop_time_s-radio.loss": "tutorial-packet-loss-survival",
}


def main() -> None:
    """Make the swarm, run the page's campaign and copy the figures."""
    campaign = re.search(r"<!-- file: loss\.toml -->\n```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert campaign is not None
    with TemporaryDirectory() as home:
        Path(home, "loss.toml").write_text(campaign[1], encoding="utf-8")
        _swarmwire(home, "new", "my_swarm")
        _swarmwire(home, "sweep", "loss.toml", "--out", "loss")
        _swarmwire(home, "report", "loss", "--response", "stop_time_s")
        for figure, shown in FIGURES.items():
            (DOCS / f"{shown}.svg").write_bytes(Path(home, "loss", "figures", f"{figure}.svg").read_bytes())


def _swarmwire(home: str, *arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "swarmwire.deploy", *arguments], cwd=home, check=True)


if __name__ == "__main__":
    main()
