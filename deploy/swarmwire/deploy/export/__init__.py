"""Exports of a run: pictures, films, captures and tables, selected by the suffix of the file.

A new exporter is a module here with an `Exporter`, and its entry in `EXPORTERS`.
"""

from pathlib import Path

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.export.capture import CAPTURE
from swarmwire.deploy.export.exporter import FLAGS, Exporter, ExportOptions
from swarmwire.deploy.export.film import GIF, MP4
from swarmwire.deploy.export.picture import ARENA, DELIVERY, VIEWER
from swarmwire.deploy.export.table import METRICS

EXPORTERS = (ARENA, DELIVERY, VIEWER, GIF, MP4, CAPTURE, METRICS)  # the first of a suffix is its default


def find_exporter(to: Path, kind: str | None) -> Exporter:
    """The exporter for a file name, and of several for this suffix the one of this kind; BadInput if there is none."""
    suffix = to.suffix.lower()
    fitting = [exporter for exporter in EXPORTERS if suffix in exporter.suffixes]
    if not fitting:
        suffixes = dict.fromkeys(suffix for exporter in EXPORTERS for suffix in exporter.suffixes)
        raise BadInput(str(to), "", f"expected a file name that ends in {', '.join(suffixes)}")
    for exporter in fitting:
        if kind in (None, exporter.name):
            return exporter
    names = [exporter.name for exporter in fitting]
    raise BadInput("--kind", "", f"expected of {suffix}: {did_you_mean(names, str(kind))}")


def export(run: Path, to: Path, options: ExportOptions, kind: str | None = None) -> str:
    """Write one file of a run folder; its suffix, and `kind` where several exporters share it, select the exporter.

    Returns a note on the content, such as `12 frames`, or an empty text. BadInput for an option that the exporter does
    not use, and for a run, a path or a value that it cannot use.
    """
    exporter = find_exporter(to, kind)
    for name, flag in FLAGS.items():
        if getattr(options, name) is not None and name not in exporter.options:
            users = dict.fromkeys(suffix for other in EXPORTERS if name in other.options for suffix in other.suffixes)
            used = f"expected --to with {', '.join(users)}; {to.suffix} ({exporter.name}) does not use it"
            raise BadInput(flag, "", used)
    return exporter.write(run, to, options)
