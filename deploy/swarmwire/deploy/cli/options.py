"""Arguments that several commands take."""

from pathlib import Path
from typing import Annotated

import typer

USUAL_SIZE_PX = 1280  # of pictures, along the longer side

ScenarioFile = Annotated[Path, typer.Argument(help="The scenario, a TOML file.", metavar="SCENARIO")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a value by its path, e.g. robots.flock.params.separation_m=0.3. Repeatable.",
        metavar="PATH=VALUE",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Packets = Annotated[
    str,
    typer.Option(
        help='Packets to record in packets.parquet: "off", "all", or a share of them, such as 0.1.',
        metavar="off|all|SHARE",
    ),
]
Runners = Annotated[
    str, typer.Option(help='Processes that run the agents: "none" (all in this one), a number, or "per-robot".')
]
Seed = Annotated[int | None, typer.Option(help="Seed instead of the scenario's.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Links = Annotated[
    bool, typer.Option("--links", help="Record radio_links.parquet: packets by sender, receiver and fate.")
]
