"""`swarmwire sweep`: a campaign in the terminal."""

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.design import vary_of
from swarmwire.deploy.campaigns.spec import CampaignPlan, SweepSpec, campaign_file, plan_of, spec_in
from swarmwire.deploy.campaigns.sweep import CAMPAIGNS, ExecutionOptions, begin_sweep, resume_sweep
from swarmwire.deploy.cli.display.sweep import SweepProgress, print_sweep
from swarmwire.deploy.cli.options import INTERRUPTED, leaving_when_hung_up
from swarmwire.deploy.cli.sweep import SweepOptions
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.runs.config import SEEDS, parse_factor, seed_list
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.interfaces import enter_user_namespace
from swarmwire.deploy.runs.record.folder import short_name, stamped_folder
from swarmwire.deploy.terminal.console import TerminalConsole


def run_sweep(options: SweepOptions) -> None:
    """Begin or resume a campaign, and print its progress and its medians."""
    plan = _plan(options)
    if plan and plan.spec.realtime and plan.scenario.radio and plan.scenario.radio.interface:
        enter_user_namespace()
    console, interrupt = TerminalConsole(quiet=options.quiet), Interrupt()
    execution = ExecutionOptions(options.executor, options.workers, options.batch, SweepProgress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if options.resume is not None:
            sweep = resume_sweep(
                options.resume, execution, retry_failed=options.retry_failed, force=options.force, plan=plan
            )
        elif plan is None or options.source is None:
            raise BadInput("SCENARIO", "", "is missing: expected a scenario or a campaign, or --resume with a folder")
        else:
            folder = options.out or stamped_folder(Path(CAMPAIGNS, short_name(options.source)))
            sweep = begin_sweep(plan, folder, shlex.join(["swarmwire", *sys.argv[1:]]), execution)
    print_sweep(sweep, console, command_path())
    if not sweep.is_over:
        raise typer.Exit(INTERRUPTED)


def _plan(options: SweepOptions) -> CampaignPlan | None:
    """Return the checked campaign; options override those of a file. None without a scenario or a file."""
    if options.source is None:
        if options.vary or options.seeds or options.overrides:
            raise BadInput(
                "SCENARIO", "", "expected the scenario of --vary, --seeds and --set; a --resume takes none of these"
            )
        return None
    varied = tuple(map(vary_of, options.vary or ()))
    overrides = tuple(options.overrides or ())
    file = campaign_file(options.source)
    if file is None:
        if options.seeds is None:
            raise BadInput("seeds", "", f"is missing: expected {SEEDS}")
        spec = SweepSpec(options.source, seed_list(options.seeds), varied, overrides=overrides)
    else:
        spec = spec_in(options.source, file, options.seeds)
        paths = {vary.path for vary in varied}
        others = (vary for vary in spec.varied if vary.path not in paths)
        spec = replace(spec, varied=(*others, *varied), overrides=(*spec.overrides, *overrides))
    return plan_of(replace(spec, **_settings(options)))


def _settings(options: SweepOptions) -> dict[str, Any]:
    """Return the fields of `SweepSpec` that options set."""
    settings = {
        "design": options.design,
        "points": options.points,
        "design_seed": options.design_seed,
        "batch": options.batch,
        "record_seeds": None if options.record_seeds is None else seed_list(options.record_seeds, "record_seeds"),
        "series": None if options.series else False,
        "realtime": parse_factor(options.realtime),
        "max_late": options.max_late,
    }
    return {name: value for name, value in settings.items() if value is not None}
