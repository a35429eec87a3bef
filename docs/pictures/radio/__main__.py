"""Draws the figures of the pages about the radio: `python -m docs.pictures.radio [NAME ...]`, all without a name."""

import sys

from docs.pictures.radio import (
    access,
    antennas,
    bursts,
    capture,
    delays,
    fading,
    path_loss,
    reception,
    shadowing,
    throughput,
    walls,
)

FIGURES = {
    "path-loss": path_loss.draw,
    "antennas": antennas.draw,
    "shadowing": shadowing.draw,
    "walls": walls.draw,
    "fading": fading.draw,
    "reception": reception.draw,
    "bursts": bursts.draw,
    "delays": delays.draw,
    "access": access.draw,
    "capture": capture.draw,
    "throughput": throughput.draw,
}

if __name__ == "__main__":
    for figure in sys.argv[1:] or FIGURES:
        FIGURES[figure]()
