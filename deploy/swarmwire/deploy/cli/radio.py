"""The commands `radio fit` and `radio probe`: a radio from logs; a radio without a run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import AsJson, BagPackets, BagPoses, Overrides, Seed, with_options

radio_app = typer.Typer(
    help="Probe an emulated radio without a run, or fit one to logs of real robots.",
    no_args_is_help=True,
)


@radio_app.command("fit")
def fit_command(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV or Parquet with t_s, tx, rx, seq, rssi_dbm, and tx_x_m, tx_y_m, rx_x_m, rx_y_m or distance_m; "
            "or a folder of robots' logs, or a CSV of theirs, without rssi_dbm; or a bag of ROS 2.",
            metavar="FILE",
        ),
    ],
    to: Annotated[
        list[Path] | None,
        typer.Option(
            help="Write a file. .toml: the radio's table, printed otherwise; .png, .svg or .pdf: a drawing of the fit. "
            "Repeatable.",
            metavar="FILE",
        ),
    ] = None,
    power_dbm: Annotated[float, typer.Option(help="Transmit power of the robots, in dBm.")] = 0.0,
    gain_dbi: Annotated[float, typer.Option(help="Gain of their antennas, in dBi.")] = 0.0,
    within: Annotated[
        float | None, typer.Option(help="Use only packets over at most this distance, in m.", metavar="M")
    ] = None,
    poses: BagPoses = None,
    packets: BagPackets = None,
) -> None:
    """Fit a radio's parameters to a log of real robots: path loss, shadowing, and losses, single or in bursts.

    A packet is lost if its row has no rssi_dbm, or if its number is missing between two rows of a link. Numbers count
    what was sent on a link (or by a robot to all). The table fits into a scenario as it stands; without path loss it
    is for a radio that has a model or a range of its own.

    Robots' networks report no signal strength: range, losses and latencies are fitted to their logs, and the delivery
    of each link is printed. Every row is a packet that arrived; a packet sent without such a row was lost.
    """
    from swarmwire.deploy.cli.actions.bag_logs import BagTopics
    from swarmwire.deploy.cli.actions.radio_fit import fit_radio_file

    topics = BagTopics(poses, packets)
    fit_radio_file(file, to or [], topics, power_dbm=power_dbm, gain_dbi=gain_dbi, within_m=within)


@dataclass(frozen=True, kw_only=True)
class ProbeOptions:
    """Options of `swarmwire radio probe`."""

    subject: Annotated[
        str,
        typer.Argument(help="A scenario, a TOML file, or a radio that `swarmwire list presets` names.", metavar="WHAT"),
    ]
    contention: Annotated[
        str | None,
        typer.Option(
            metavar="N,BYTES,INTERVAL_S", help="Of a preset: nodes at one place, payload and sending rate of each."
        ),
    ] = None
    overrides: Overrides = None
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, help="With --contention: number of runs of 2 s, seeds 1, 2, …")
    ] = 10
    position: Annotated[
        str | None,
        typer.Option("--at", help="Of a scenario: the place in m that the map is drawn from.", metavar="X,Y"),
    ] = None
    robot: Annotated[
        str | None, typer.Option("--from", help="Instead: the robot. Default: the first.", metavar="ROBOT")
    ] = None
    payload_bytes: Annotated[
        int | None, typer.Option("--bytes", help="Of a scenario: payload. Default: the most the radio takes.")
    ] = None
    seed: Seed = None
    to: Annotated[Path | None, typer.Option(help="Draw the coverage: .png, .svg or .pdf.")] = None
    as_json: AsJson = False


@radio_app.command("probe")
@with_options
def probe_command(options: ProbeOptions) -> None:
    """Probe a radio without a run: coverage, delivery over distance, contention.

    A scenario: the strength over its arena from one place, and the delivery of lone packets over distance, as walls and
    shadowing make it; without robots in between. A preset: PDR and mean delay among nodes in one spot that
    all broadcast, as JSON. For example:

      swarmwire radio probe scenarios/flocking-802154.toml --to coverage.png

      swarmwire radio probe ieee802154 --contention 20,20,0.1
    """
    from swarmwire.deploy.cli.actions.radio_probe import probe_radio

    probe_radio(options)
