"""The report of a single run, from its run folder alone."""

from pathlib import Path

from swarmwire.metrics.report.in_words import counted, number
from swarmwire.metrics.report.run_data import RunData, read_run
from swarmwire.metrics.report.run_sections.measured import measured
from swarmwire.metrics.report.run_sections.radio import radio
from swarmwire.metrics.report.run_sections.what_happened import what_happened
from swarmwire.metrics.report.run_sections.what_was_run import groups, scenario_text, what_was_run
from swarmwire.metrics.report.section import Report


def run_report(folder: Path) -> Report:
    """What was run, over time, where, the radio, the metrics: with what there is of a run that was killed or goes on.

    Of several arenas the first is drawn, and tables tell of all. A table that was not recorded, or is damaged, costs
    its figure, and the text says so. BadInput where there is no run folder, or its `static.json` or summary cannot be
    read, or without matplotlib.
    """
    run = read_run(folder)
    sections = (what_was_run(run), what_happened(run), radio(run), measured(run), *scenario_text(run))
    return Report(run.static.name, sections, _about(run))


def _about(run: RunData) -> str:
    static = run.static
    seeds = f"seed {static.seeds[0]}" if static.arenas == 1 else counted(static.arenas, "arena")
    time_s = "killed or going on" if run.summary is None else f"{number(run.summary['sim_time_s'])} s"
    return f"A run of {groups(static)}, {seeds}, {time_s}."
