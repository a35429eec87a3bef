"""`swarmwire export`: a file of a run."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import cast

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.exporters import EXPORTERS, FLAGS, Exporter, ExportOptions
from swarmwire.deploy.terminal.console import TerminalConsole

DEFAULT_NAME = "picture.png"
# Writes the file of a run folder, and returns a note on its content, such as "12 frames", or "". Raises BadInput for a
# run, a path or an option that it cannot use, and leaves no file then.
Writer = Callable[[Path, Path, ExportOptions], str]


def export_run(run: Path, to: Path | None, options: ExportOptions, kind: str | None) -> None:
    """Export a file, and print its path."""
    file = to or run / DEFAULT_NAME
    note = export(run, file, options, kind) or f"{file.stat().st_size / 1e6:.2g} MB"
    TerminalConsole().print(f"written: {file} ({note})", soft_wrap=True)


def export(run: Path, to: Path, options: ExportOptions, kind: str | None = None) -> str:
    """Write one file of a run folder, and return a note on its content, such as "12 frames", or "".

    The suffix selects the exporter, together with `kind` if several exporters share it. BadInput for an option that the
    exporter does not use, and for a run, a path or a value that it cannot use.
    """
    exporter = find_exporter(to, kind)
    for name, flag in FLAGS.items():
        if getattr(options, name) is not None and name not in exporter.options:
            suffixes = dict.fromkeys(
                suffix for other in EXPORTERS if name in other.options for suffix in other.suffixes
            )
            expected = f"expected --to with {', '.join(suffixes)}; {to.suffix} ({exporter.name}) does not use it"
            raise BadInput(flag, "", expected)
    module, _, function = exporter.function.partition(":")
    writer = getattr(import_module(f"swarmwire.deploy.cli.actions.{module}"), function)
    return cast("Writer", writer)(run, to, options)


def find_exporter(to: Path, kind: str | None) -> Exporter:
    """Return the exporter for a file name and a kind; BadInput if there is none."""
    suffix = to.suffix.lower()
    candidates = [exporter for exporter in EXPORTERS if suffix in exporter.suffixes]
    if not candidates:
        suffixes = dict.fromkeys(suffix for exporter in EXPORTERS for suffix in exporter.suffixes)
        raise BadInput(str(to), "", f"expected a file name that ends in {', '.join(suffixes)}")
    for exporter in candidates:
        if kind in (None, exporter.name):
            return exporter
    names = [exporter.name for exporter in candidates]
    raise BadInput("--kind", "", f"expected {did_you_mean(names, str(kind))}, for {suffix}")
