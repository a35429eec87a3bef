"""The picture of a behaviour: its scenario run, and drawn as `swarmwire export` does, with longer trails."""

from pathlib import Path
from tempfile import TemporaryDirectory

from docs.behaviours.places import SCENARIOS
from docs.behaviours.shown import find_shown
from docs.experiments.places import Places

SIZE_PX = 960
COLORS = 128


def draw_picture(name: str, places: Places) -> Path:
    """Run the behaviour's scenario and draw it into NAME.png; where that is."""
    from PIL import Image

    from swarmwire.deploy import Recording, run
    from swarmwire.metrics.drawing.animation import FilmFigure
    from swarmwire.metrics.drawing.film import film_of
    from swarmwire.metrics.run_folder.reader import RunFolder

    shown, to = find_shown(name, places), places.pages / f"{name}.png"
    with TemporaryDirectory() as folder:
        run(SCENARIOS / f"{name}.toml", out=folder, record=Recording(rrd=False))
        film = film_of(RunFolder(Path(folder)), 0, name)
        figure = FilmFigure(film, SIZE_PX, [*shown.metrics], shown.trail_s)
        at = len(film.time_s) - 1 if shown.at_s is None else film.index_at(shown.at_s)
        picture = Path(folder) / to.name
        figure.save(at, picture)
        Image.open(picture).convert("RGB").quantize(COLORS).save(to, optimize=True)
    return to
