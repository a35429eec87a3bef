"""Run ns-3 and the radio medium beside each other, and compare: `python -m benchmarks.ns3 --help`."""

import hashlib
import multiprocessing
import sys
import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, track

from benchmarks.ns3.closed_forms import closed_forms
from benchmarks.ns3.comparison import (
    Figures,
    Row,
    figures_of,
    filled,
    recorded,
    summary,
    table,
    write_csv,
    write_record,
)
from benchmarks.ns3.configurations import Configuration
from benchmarks.ns3.sections import SECTIONS
from benchmarks.ns3.simulators import NETWORK, Received, ours, theirs
from benchmarks.ns3.speed import speed
from benchmarks.ns3.trace import trace
from swarmwire.comms.base.atomic import atomic_write
from swarmwire.comms.base.errors import BadInput

TEACH = """\
ns-3 and the medium get the same nodes, places and send times, seed by seed; figures
that differ by more than 0.02 of delivery, 5 % of mean delay or 3 % of throughput are
misses. The exit status is 1 if a miss has no written reason.

  make validation                                       everything, into docs/dev/validation.md
  python -m benchmarks.ns3 --quick                      a look: fewer seeds, so that some rows miss by chance
  python -m benchmarks.ns3 --only area --cache runs/ns3 one section; ns-3's part is kept
  python -m benchmarks.ns3 --recorded                   without ns-3: its recorded figures
"""
MISSING = (
    "ns-3 is not there: `.ci/sync --group validation` brings its wheel (x86-64 Linux, CPython 3.11 to 3.13); "
    "--recorded does without"
)
OTHERS = {
    "trace": "nodes that move by a trace",
    "closed-forms": "closed forms and ARGoS's rule",
    "speed": "simulated over CPU time",
}


def main(arguments: Sequence[str]) -> int:
    """Compare, print or write the tables; 1 if a miss is not explained."""
    options = _options(arguments)
    if not options.recorded and find_spec("ns3") is None:
        print(MISSING, file=sys.stderr)
        return 2
    others = ["trace"] if options.recorded else [] if options.quick else OTHERS
    names: list[str] = options.only or [*SECTIONS, *others]
    sections = {name: SECTIONS[name]() for name in names if name in SECTIONS}
    if options.quick:
        sections = {name: [_quick(each) for each in configurations] for name, configurations in sections.items()}
    every = [each for configurations in sections.values() for each in configurations]
    figures = recorded() if options.recorded else _run(every, Path(options.cache), options.processes)
    our_figures = _run_ours(every, options.processes)
    rows = {
        name: [Row.compare(each, figures[each], our_figures[each]) for each in configurations]
        for name, configurations in sections.items()
    }
    if options.record and figures:
        write_record(figures, [each for make in SECTIONS.values() for each in make()])
    tables = {name: table(section_rows) for name, section_rows in rows.items()}
    if not set(SECTIONS) - set(names):
        tables["summary"] = summary(rows)
    if "trace" in names:
        tables["trace"] = trace(options.recorded, options.record)
    if "closed-forms" in names:
        tables["closed-forms"] = closed_forms()
    if "speed" in names:
        tables["speed"] = speed(options.build)
    _show(tables, options.page)
    return int(
        not options.quick
        and any(row.misses and row.reason is None for section_rows in rows.values() for row in section_rows)
    )


def _options(arguments: Sequence[str]) -> Namespace:
    described = [f"  {name:13}{_first_line(make)}" for name, make in SECTIONS.items()]
    described += [f"  {name:13}{help_text}" for name, help_text in OTHERS.items()]
    parser = ArgumentParser(
        prog="python -m benchmarks.ns3",
        description=TEACH,
        epilog="\n".join(["sections:", *described]),
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", metavar="SECTION", choices=[*SECTIONS, *OTHERS], help="these sections")
    parser.add_argument("--quick", action="store_true", help="3 seeds of 1 s for many nodes of 802.11")
    folder = Path(tempfile.gettempdir()) / "swarmwire-ns3"
    parser.add_argument("--cache", metavar="DIR", default=str(folder), help=f"keeps ns-3's results ({folder})")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="of ns-3 at a time (2)")
    parser.add_argument("--page", type=Path, metavar="FILE", help="put the tables between this page's marks")
    parser.add_argument("--recorded", action="store_true", help="compare with the record instead of running ns-3")
    parser.add_argument("--record", action="store_true", help="keep ns-3's figures in the record of the tests")
    parser.add_argument("--build", type=Path, metavar="DIR", help="speed: also an ns-3 build with include/ and lib/")
    options = parser.parse_args(arguments)
    if options.record and (options.recorded or options.quick):
        parser.error("--record: expected ns-3, hence neither --recorded nor --quick")
    return options


def _quick(configuration: Configuration) -> Configuration:
    """Less of what takes ns-3 long: many nodes of 802.11."""
    is_cheap = configuration.standard == "802.15.4" or configuration.layout == "line"
    return configuration if is_cheap else replace(configuration, seeds=3, measured_s=1.0)


def _first_line(make: Callable[[], list[Configuration]]) -> str:
    return (make.__doc__ or "").partition("\n")[0]


def _run_ours(configurations: list[Configuration], processes: int) -> dict[Configuration, Figures]:
    """Return the medium's figures of each."""
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        begun = pool.map(ours, configurations)
        shown = track(begun, "ours", len(configurations), console=Console(stderr=True))
        return {each: figures_of(each, received) for each, received in zip(configurations, shown, strict=True)}


def _run(configurations: list[Configuration], cache: Path, processes: int) -> dict[Configuration, Figures]:
    """ns-3's figures of each, from the cache or from child processes: ns-3 is one simulator for a whole process."""
    cache.mkdir(parents=True, exist_ok=True)
    files = {each: cache / f"{_fingerprint(each)}.npz" for each in configurations}
    figures = {each: figures_of(each, _read(file)) for each, file in files.items() if file.exists()}
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    spawn = multiprocessing.get_context("spawn")
    with Progress(*columns, console=Console(stderr=True)) as progress, ProcessPoolExecutor(processes, spawn) as pool:
        bar = progress.add_task("ns-3", total=len(files), completed=len(figures))
        begun = {pool.submit(theirs, each): each for each in files if each not in figures}
        try:
            for done in as_completed(begun):
                each, received = begun[done], done.result()
                with atomic_write(files[each]) as aside:  # a half of a file would be read in the next comparison
                    np.savez_compressed(aside, packets=received.packets, delay_ns=received.delay_ns)
                figures[each] = figures_of(each, received)
                progress.update(bar, advance=1, description=f"ns-3: {' '.join(each.cells)}")
        finally:  # after Ctrl-C or an error the pool would run all that is left, for hours
            pool.shutdown(wait=False, cancel_futures=True)
    return figures


def _fingerprint(configuration: Configuration) -> str:
    """Of all that ns-3 is given."""
    inputs = [NETWORK.read_text(encoding="utf-8"), *map(configuration.ns3_input, range(configuration.seeds))]
    return hashlib.sha256("\n".join(inputs).encode()).hexdigest()[:32]


def _read(file: Path) -> Received:
    with np.load(file) as arrays:
        return Received(arrays["packets"], arrays["delay_ns"])


def _show(tables: dict[str, list[str]], page: Path | None) -> None:
    if page is not None:
        rows = write_csv(page, {name: lines for name, lines in tables.items() if name in {*SECTIONS, "closed-forms"}})
        page.write_text(filled(page, tables | rows), encoding="utf-8")
        return
    for name, lines in tables.items():
        print(f"\n## {name}\n", *lines, sep="\n")


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except BadInput as error:
        sys.exit(str(error))
