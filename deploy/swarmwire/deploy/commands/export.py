"""`swarmwire export`."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import track
from typer.core import TyperCommand

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.commands.export_traffic import SUFFIX, export_traffic

if TYPE_CHECKING:
    from swarmwire.metrics.drawing.film_figure import FilmFigure
    from swarmwire.metrics.film import Film
    from swarmwire.metrics.footage import Footage

Kind = Literal["png", "gif", "mp4", "pdr"]
END = "end"
USUAL_NAME = {"png": "picture.png", "gif": "film.gif", "mp4": "film.mp4", "pdr": "pdr.png"}
USUAL_SIZE_PX = {"png": 1280, "gif": 480, "mp4": 960, "pdr": 1280}
USUAL_FRAMES_PER_S = {"gif": 10.0, "mp4": 25.0}
SUFFIXES = {"png": (".png", ".svg", ".pdf"), "gif": (".gif",), "mp4": (".mp4",), "pdr": (".png", ".svg", ".pdf")}
OLD_CAPTURES = (".pcap", ".cap")  # which hold no comments
PALETTE_SAMPLES = 8


class ExportCommand(TyperCommand):
    """The command where a bare `--png` means the end of the run: typer knows no option whose value may be left out."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, after `end` was put behind a `--png` without a time."""
        whole: list[str] = []
        for argument in args:
            if whole and whole[-1] == "--png" and not _is_time(argument):
                whole.append(END)
            whole.append(argument)
        return super().parse_args(ctx, [*whole, END] if whole and whole[-1] == "--png" else whole)


def export_command(
    run: Annotated[Path, typer.Argument(help="A run folder, of a run that goes on or was killed too.", metavar="RUN")],
    png: Annotated[
        str | None,
        typer.Option(help="A picture of the moment T, in s; the end if left out. The usual kind.", metavar="[T]"),
    ] = None,
    gif: Annotated[bool, typer.Option("--gif", help="A film as GIF.")] = False,
    mp4: Annotated[bool, typer.Option("--mp4", help="A film as MP4 (H.264).")] = False,
    pdr: Annotated[
        bool, typer.Option("--pdr", help="A picture of the radio: the share of receivers that heard, over distance.")
    ] = False,
    to: Annotated[
        Path | None,
        typer.Option(
            help="The file; a picture may be .png, .svg or .pdf; .pcapng captures the radio. Default: picture.png, "
            "film.* or pdr.png in RUN."
        ),
    ] = None,
    from_s: Annotated[
        float | None, typer.Option("--from", help="Start of the film or capture, in s.", metavar="S")
    ] = None,
    until_s: Annotated[
        float | None, typer.Option("--until", help="End of the film or capture, in s.", metavar="S")
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Frames per second. Default: 10 (GIF), 25 (MP4), or as many as there are ticks."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="Simulated seconds per second. Default: 1, or what makes 300 frames at most."),
    ] = None,
    arena: Annotated[int, typer.Option(help="Which of several arenas.")] = 0,
    metric: Annotated[
        list[str] | None, typer.Option(help="A metric to plot beside the arena. Repeatable. Default: the usual three.")
    ] = None,
    size: Annotated[
        int | None, typer.Option(help="Longer side in pixels. Default: 1280 (pictures), 480 (GIF), 960 (MP4).")
    ] = None,
) -> None:
    """Draw a run as a picture or a film, without a screen: the arena, and metrics beside it. Or capture its radio.

    Lines join robots in radio range and sight of one another, whatever partitions and failed radios part them. A file
    that ends in .pcapng holds the frames on air of a run with --packets all, for Wireshark.
    """
    console = Console(highlight=False)
    if to is not None and to.suffix.lower() == SUFFIX:
        _refuse_drawing_options(
            png is not None or gif or mp4 or pdr, {"--fps": fps, "--speed": speed, "--metric": metric, "--size": size}
        )
        frames = export_traffic(run, to, arena, from_s, until_s)
        console.print(f"written: {to} ({frames} frames)", soft_wrap=True)
        return
    if to is not None and to.suffix.lower() in OLD_CAPTURES:
        raise BadInput(str(to), "", f"expected a file name that ends in {SUFFIX} for a capture")
    from swarmwire.metrics.drawing.film_figure import FilmFigure
    from swarmwire.metrics.drawing.whole_file import check_path

    kind = _kind(png, gif, mp4, pdr)
    target, size_px = to or run / USUAL_NAME[kind], USUAL_SIZE_PX[kind] if size is None else size
    if kind in ("png", "pdr"):
        _refuse_film_options({"--from": from_s, "--until": until_s, "--fps": fps, "--speed": speed})
    if kind == "pdr":
        _draw_pdr(run, arena, target, size_px)
    else:
        film = _film(run, arena)
        check_path(target, SUFFIXES[kind])
        figure = FilmFigure(film, size_px, metric)
        if kind == "png":
            figure.save(film.index_at(_time_s(png or END, film)), target)
        else:
            _write_film(figure, _footage(film, kind, from_s, until_s, fps, speed), kind, target, console)
    console.print(f"written: {target} ({target.stat().st_size / 1e6:.2g} MB)", soft_wrap=True)


def _draw_pdr(run: Path, arena: int, to: Path, size_px: int) -> None:
    from swarmwire.metrics.drawing.distance_sheet import draw_distances
    from swarmwire.metrics.run_folder import RunFolder

    draw_distances(RunFolder(run), arena, to, size_px)


def _film(run: Path, arena: int) -> "Film":
    from swarmwire.metrics.film import film_of
    from swarmwire.metrics.run_folder import RunFolder

    return film_of(RunFolder(run), arena, str(run))


def _write_film(figure: "FilmFigure", cut: "Footage", kind: Kind, to: Path, console: Console) -> None:
    from swarmwire.metrics.drawing.gif import write_gif
    from swarmwire.metrics.drawing.mp4 import write_mp4
    from swarmwire.metrics.drawing.whole_file import whole_file

    count = len(cut.ticks)
    console.print(f"{count} frames, {cut.frames_per_s:g} a second, {cut.speed:g} x real time")
    shown = track(cut.ticks, "drawing", console=console, transient=True, disable=not console.is_terminal)
    frames = (figure.frame(int(tick)) for tick in shown)
    with whole_file(to) as part:
        if kind == "mp4":
            write_mp4(part, frames, cut.frames_per_s)
        else:
            some = cut.ticks[:: max(1, count // PALETTE_SAMPLES)]
            write_gif(part, frames, [figure.frame(int(tick)).copy() for tick in some], cut.frames_per_s)


def _footage(
    film: "Film", kind: Kind, from_s: float | None, until_s: float | None, fps: float | None, speed: float | None
) -> "Footage":
    from swarmwire.metrics.footage import footage

    return footage(film.time_s, film.static.rate_hz, from_s, until_s, fps, speed, USUAL_FRAMES_PER_S[kind])


def _kind(png: str | None, gif: bool, mp4: bool, pdr: bool) -> Kind:
    """What was asked for; a picture if nothing was."""
    if (png is not None) + gif + mp4 + pdr > 1:
        raise BadInput("export", "", "expected one of --png, --gif, --mp4 and --pdr at a time")
    return "gif" if gif else "mp4" if mp4 else "pdr" if pdr else "png"


def _refuse_film_options(given: dict[str, float | None]) -> None:
    for option, value in given.items():
        if value is not None:
            raise BadInput(option, "", "expected --gif or --mp4 with it; a picture is of one moment, --png T")


def _refuse_drawing_options(draws: bool, given: Mapping[str, object]) -> None:
    if draws:
        raise BadInput(
            "--to", "", f"expected a file name for --png, --gif, --mp4 or --pdr; {SUFFIX} is a capture, without these"
        )
    for option, value in given.items():
        if value is not None:
            raise BadInput(option, "", f"expected a picture or a film with it; {SUFFIX} is neither")


def _time_s(text: str, film: "Film") -> float:
    """The moment asked for, in s; BadInput if it is none of the recorded ones."""
    first, last = float(film.time_s[0]), float(film.time_s[-1])
    if text == END:
        return last
    if not _is_time(text) or not first <= float(text) <= last + 1.0 / film.static.rate_hz:
        raise BadInput("--png", "", f"expected a time that was recorded, {first:g} to {last:g} s, or {END}; got {text}")
    return float(text)


def _is_time(text: str) -> bool:
    if text == END:
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True
