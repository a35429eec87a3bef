"""A browser shows a report on a phone's screen without anything that reaches beyond it."""

import html
import shutil
import subprocess

import pytest

from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.report.campaign import campaign_report
from swarmwire.metrics.report.page import page
from tests.support.metrics.campaign.campaigns import write_campaign

pytest.importorskip("matplotlib", reason="needs the extra [report]")
PHONE_PX = 390

# The window of a browser without a screen is wider than a phone: a frame is not.
FRAME = """<!doctype html><body>
<iframe id="phone" style="border:0;width:{width}px;height:800px" srcdoc="{page}"></iframe>
<script>
document.getElementById("phone").onload = (event) => {{
  const inside = event.target.contentDocument.documentElement;
  const wide = [...inside.querySelectorAll("main *:not(.scroll *, svg *)")]
    .filter((element) => element.getBoundingClientRect().right > {width} + 0.5);
  document.body.textContent = `is ${{inside.scrollWidth}} of ${{inside.clientWidth}} px, beyond: ` +
    wide.map((element) => element.tagName).join(" ");
}};
</script>"""


@pytest.fixture
def browser():
    """Skips where there is none that starts."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        found = shutil.which(name)
        if found and subprocess.run([found, "--version"], capture_output=True, timeout=60, check=False).returncode == 0:
            return found
    pytest.skip("needs chromium")


def test_nothing_reaches_beyond_a_phones_screen(tmp_path, browser):
    vary = {"radio.loss": [0.0, 0.2, 0.4, 0.6], "robots.a-group-of-a-long-name.count": [5, 10, 20]}
    folder = write_campaign(tmp_path / "a", vary, (1, 2, 3), failed=(1,), missing=(2,), name="A" * 90)
    text = page(campaign_report(CampaignFolder(folder), ["order", "aggregation_time_s"]))
    frame = tmp_path / "frame.html"
    frame.write_text(FRAME.format(width=PHONE_PX, page=html.escape(text)), encoding="utf-8")
    quiet = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars")
    command = [browser, *quiet, f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000", "--dump-dom"]
    ended = subprocess.run([*command, frame.as_uri()], capture_output=True, text=True, timeout=100, check=True)
    assert f"is {PHONE_PX} of {PHONE_PX} px, beyond: </body>" in ended.stdout
