"""Make convoy.csv, the motion of eight cars on a handling course, for convoy.toml.

    python examples/middleware/convoy.py            downloads 3.8 MB
    python examples/middleware/convoy.py FILE.csv   takes the file that you have

The cars drove in a platoon near Zalaegerszeg on 9 October 2019, with positions by satellite 10 times a second: OpenACC,
European Commission, Joint Research Centre; M. Makridis et al., Transportation Research Part C 125, 103047 (2021). JRC's
own server has no lasting address of a single file, so this is the copy of a project on GitHub.
"""

import csv
import hashlib
import sys
import urllib.request
from pathlib import Path

COMMIT = "8781ec31a976113210a9809b98345c76594c3896"
URL = (
    f"https://raw.githubusercontent.com/thibault-charlottin/ACC-platoon-fuel-consumption/{COMMIT}"
    "/data/OpenACC_data/short_setting/handling_part2.csv"
)
SHA256 = "e202895e5aedfbbf4184f24b9d76d5ebe18fe53959facbcf36336258406d6bba"
CARS = range(2, 10)  # the first recorded no position
BEGIN_S, DURATION_S = 550.0, 70.0  # without a gap
FILE = Path(__file__).parent / "convoy.csv"


def samples(text: str) -> list[tuple[float, int, float, float]]:
    """Return time in s, car, and its position in m east and north of the middle of all, in the order of times."""
    rows = list(csv.reader(text.splitlines()))
    head = next(index for index, row in enumerate(rows) if row and row[0] == "Time")
    column = {name: index for index, name in enumerate(rows[head])}
    values = [
        (float(row[0]) - BEGIN_S, car, float(row[column[f"E{car}"]]), float(row[column[f"N{car}"]]))
        for row in rows[head + 1 :]
        if -0.01 < float(row[0]) - BEGIN_S < DURATION_S + 0.01
        for car in CARS
    ]
    _, _, east_m, north_m = zip(*values, strict=True)
    middle_east_m, middle_north_m = (min(east_m) + max(east_m)) / 2, (min(north_m) + max(north_m)) / 2
    return [(at_s, car, x_m - middle_east_m, y_m - middle_north_m) for at_s, car, x_m, y_m in values]


def main(files: list[str]) -> None:
    """Write convoy.csv."""
    if files:
        data = Path(files[0]).read_bytes()
    else:
        with urllib.request.urlopen(URL, timeout=60) as answer:
            data = answer.read()
    if hashlib.sha256(data).hexdigest() != SHA256:
        raise SystemExit(f"{files[0] if files else URL}: is not the file that this script knows (SHA-256)")
    with FILE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("t_s", "robot", "x_m", "y_m"))
        for at_s, car, x_m, y_m in samples(data.decode("latin-1")):
            writer.writerow((f"{at_s:.1f}", car, f"{x_m:.2f}", f"{y_m:.2f}"))
    print(f"written: {FILE}")


if __name__ == "__main__":
    main(sys.argv[1:])
