"""How a page looks in chromium on a screen so wide, from a heading on.

`python -m docs.pictures.page PAGE.html[#HEADING] PICTURE.png WIDTH HEIGHT`
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

QUIET = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", "--disable-sync",
         "--disable-background-networking")  # fmt: skip
MIN_PX = 500  # chromium's window is no narrower: what is shown on a phone stands in a frame of it


def main(page: Path, heading: str, picture: Path, width_px: int, height_px: int) -> None:
    """Draw so much of the page."""
    with TemporaryDirectory() as folder:
        frame = Path(folder) / "frame.html"
        size = f"width:{width_px}px;height:{height_px}px"
        style = f"position:fixed;top:0;left:0;border:0;{size}"
        frame.write_text(
            f'<!doctype html><iframe style="{style}" src="{page.resolve().as_uri()}#{heading}"></iframe>', "utf-8"
        )
        shot = Path(folder) / "shot.png"
        window = f"--window-size={max(width_px, MIN_PX)},{height_px}"
        command = ["chromium", *QUIET, f"--user-data-dir={folder}/profile", window, f"--screenshot={shot}"]
        subprocess.run([*command, frame.as_uri()], check=True, capture_output=True, timeout=100)
        Image.open(shot).convert("RGB").crop((0, 0, width_px, height_px)).quantize(64).save(picture, optimize=True)


if __name__ == "__main__":
    file, _, at = sys.argv[1].partition("#")
    main(Path(file), at, Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
