"""`swarmwire export`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from typer.core import TyperCommand

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.export_film import Cut, export_film
from swarmwire.deploy.cli.export_picture import END, export_distances, export_picture, is_time
from swarmwire.deploy.cli.export_traffic import SUFFIX, export_traffic

Kind = Literal["png", "gif", "mp4", "pdr"]
USUAL_NAME = {"png": "picture.png", "gif": "film.gif", "mp4": "film.mp4", "pdr": "pdr.png"}
USUAL_SIZE_PX = {"png": 1280, "gif": 480, "mp4": 960, "pdr": 1280}
OLD_CAPTURES = (".pcap", ".cap")  # which hold no comments


class ExportCommand(TyperCommand):
    """The command where a bare `--png` means the end of the run: typer knows no option whose value may be left out."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, after `end` was put behind a `--png` without a time."""
        whole: list[str] = []
        for argument in args:
            if whole and whole[-1] == "--png" and not is_time(argument):
                whole.append(END)
            whole.append(argument)
        return super().parse_args(ctx, [*whole, END] if whole and whole[-1] == "--png" else whole)


Run = Annotated[Path, typer.Argument(help="A run folder, of a run that goes on or was killed too.", metavar="RUN")]
Png = Annotated[
    str | None,
    typer.Option(help="A picture of the moment T, in s; the end if left out. The usual kind.", metavar="[T]"),
]
Gif = Annotated[bool, typer.Option("--gif", help="A film as GIF.")]
Mp4 = Annotated[bool, typer.Option("--mp4", help="A film as MP4 (H.264).")]
Pdr = Annotated[
    bool, typer.Option("--pdr", help="A picture of the radio: the share of receivers that received, over distance.")
]
To = Annotated[
    Path | None,
    typer.Option(
        help="The file; a picture may be .png, .svg or .pdf; .pcapng captures the radio. Default: picture.png, "
        "film.* or pdr.png in RUN."
    ),
]
From = Annotated[float | None, typer.Option("--from", help="Start of the film or capture, in s.", metavar="S")]
Until = Annotated[float | None, typer.Option("--until", help="End of the film or capture, in s.", metavar="S")]
FramesPerS = Annotated[
    float | None,
    typer.Option(help="Frames per second. Default: 10 (GIF), 25 (MP4), or as many as there are ticks."),
]
Speed = Annotated[
    float | None,
    typer.Option(help="Simulated seconds per second. Default: 1, or what makes 300 frames at most."),
]
Arena = Annotated[int, typer.Option(help="Which of several arenas.")]
Metric = Annotated[
    list[str] | None, typer.Option(help="A metric to plot beside the arena. Repeatable. Default: the usual three.")
]
Size = Annotated[
    int | None, typer.Option(help="Longer side in pixels. Default: 1280 (pictures), 480 (GIF), 960 (MP4).")
]


def export_command(
    run: Run,
    png: Png = None,
    gif: Gif = False,
    mp4: Mp4 = False,
    pdr: Pdr = False,
    to: To = None,
    from_s: From = None,
    until_s: Until = None,
    fps: FramesPerS = None,
    speed: Speed = None,
    arena: Arena = 0,
    metric: Metric = None,
    size: Size = None,
) -> None:
    """Draw a run as a picture or a film, without a screen: the arena, and metrics beside it. Or capture its radio.

    Lines join robots in radio range and sight of one another, whatever partitions and failed radios part them. A file
    that ends in .pcapng holds the frames on air of a run with --packets all, for Wireshark.
    """
    console = Console(highlight=False)
    if to is not None and _is_capture(to):
        drawn = {"--fps": fps, "--speed": speed, "--metric": metric, "--size": size}
        _refuse_drawing_options(png is not None or gif or mp4 or pdr, drawn)
        frames = export_traffic(run, to, arena, from_s, until_s)
        console.print(f"written: {to} ({frames} frames)", soft_wrap=True)
        return
    kind = _kind(png, gif, mp4, pdr)
    target, size_px = to or run / USUAL_NAME[kind], USUAL_SIZE_PX[kind] if size is None else size
    if kind in ("gif", "mp4"):
        export_film(kind, run, target, arena, Cut(from_s, until_s, fps, speed), size_px, metric, console)
    else:
        _refuse_film_options({"--from": from_s, "--until": until_s, "--fps": fps, "--speed": speed})
        if kind == "png":
            export_picture(run, target, arena, png or END, size_px, metric)
        else:
            export_distances(run, target, arena, size_px)
    console.print(f"written: {target} ({target.stat().st_size / 1e6:.2g} MB)", soft_wrap=True)


def _is_capture(to: Path) -> bool:
    """Whether the file's name asks for a capture; BadInput for a kind of capture that is not written."""
    if to.suffix.lower() in OLD_CAPTURES:
        raise BadInput(str(to), "", f"expected a file name that ends in {SUFFIX} for a capture")
    return to.suffix.lower() == SUFFIX


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
