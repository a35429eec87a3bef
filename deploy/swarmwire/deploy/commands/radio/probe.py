"""`swarmwire radio probe`."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from swarmwire.comms.errors import BadInput


def probe_command(
    preset: Annotated[str, typer.Argument(help="A radio that `swarmwire list presets` tells.")],
    contention: Annotated[
        str, typer.Option(metavar="N,BYTES,INTERVAL_S", help="Nodes in one spot, what each sends, and how often.")
    ],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="A value of the radio: radio.loss=0.1.")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=10_000, help="How many runs, seeds 1, 2, …")] = 10,
    measured_s: Annotated[float, typer.Option(min=0.001, max=3600, help="Measured time of each.")] = 2.0,
) -> None:
    """Print delivery ratio and mean delay among nodes in one spot that all broadcast, as JSON.

    For example, to compare with another simulator:

      swarmwire radio probe ieee802154 --contention 20,20,0.1
    """
    # Imported here: pydantic and numba take a second, which --help should not.
    from swarmwire.comms.air.contention import contention as contend
    from swarmwire.deploy.probe import radio_of

    nodes, payload_bytes, interval_s = _parts(contention)
    radio = radio_of(preset, settings or [])
    found = contend(radio, nodes, payload_bytes, interval_s, range(1, runs + 1), measured_s=measured_s)
    typer.echo(json.dumps(asdict(found)))


def _parts(text: str) -> tuple[int, int, float]:
    expected = "expected nodes (2 or more), bytes and an interval of 0.001 to 1 s, such as 20,20,0.1"
    try:
        nodes, payload_bytes, interval_s = text.split(",")
        found = int(nodes), int(payload_bytes), float(interval_s)
    except ValueError:
        raise BadInput("--contention", "", expected) from None
    if not (2 <= found[0] <= 10_000 and 0 <= found[1] <= 65_535 and 0.001 <= found[2] <= 1.0):
        raise BadInput("--contention", "", expected)
    return found
