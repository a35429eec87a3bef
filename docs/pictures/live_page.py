"""Draws docs/page.png: the page of a run that was broken and mended by hand, in chromium.

`python -m docs.pictures.live_page [PICTURE.png [WIDTH [HEIGHT [dark|light]]]]`
"""

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, cast

from PIL import Image
from playwright.sync_api import Page, sync_playwright

DOCS = Path(__file__).parents[1]
SCENARIO = DOCS.parent / "scenarios" / "jammed.toml"
CHROMIUM = "/usr/bin/chromium"
OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
           "--disable-background-networking", "--disable-component-update", "--use-gl=angle",
           "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # fmt: skip
PATIENCE_MS = 120_000
LOAD_MS = 12_000  # until rerun's viewer has loaded and draws, without a graphics card
DRAW_MS = 15_000  # until it has drawn the newest tick


def main(picture: Path, width_px: int, height_px: int, theme: Literal["dark", "light"]) -> None:
    """Run, break, mend and draw."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "swarmwire.deploy", "run", str(SCENARIO), "--runners", "4", "--ui"]
        command += ["--out", f"{folder}/run", "--no-rrd"]
        shot = Path(folder, "shot.png")
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as run, sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(OPTIONS))
            page = browser.new_page(viewport={"width": width_px, "height": height_px}, color_scheme=theme)
            page.set_default_timeout(PATIENCE_MS)
            try:
                page.goto(_address(run))
                page.wait_for_timeout(LOAD_MS)
                _break_and_mend(page)
                page.wait_for_timeout(DRAW_MS)
                page.screenshot(path=shot)
            finally:
                browser.close()
                run.kill()  # the page ends with it; a run that is told to end waits for whoever looks at its page
        Image.open(shot).convert("RGB").save(picture, optimize=True)


def _break_and_mend(page: Page) -> None:
    """What people may do to a flock, and what its scenario has in store for it."""
    page.click("#play")
    _until(page, 25)
    page.select_option("#robot", "flock-3")
    page.click("#kill")
    _until(page, 40)
    page.click("#halve-x")
    _until(page, 60)
    page.click("#heal")
    page.fill("#radio-loss", "0.2")
    _until(page, 100)
    page.click("#play")


def _until(page: Page, tick: int) -> None:
    while int(page.get_attribute("#ticks", "data-tick") or 0) < tick:
        page.wait_for_timeout(100)


def _address(run: "subprocess.Popen[str]") -> str:
    assert run.stdout is not None
    for line in run.stdout:
        if address := re.search(r"http://127\.0\.0\.1:\d+/\S+/", line):
            return address[0]
    raise SystemExit("the run told no address")


if __name__ == "__main__":
    arguments = dict(enumerate(sys.argv[1:]))
    size_px = int(arguments.get(1, "1400")), int(arguments.get(2, "900"))
    scheme = cast("Literal['dark', 'light']", arguments.get(3, "dark"))
    main(Path(arguments.get(0, DOCS / "page.png")), *size_px, scheme)
