"""A radio's fit as TOML that a scenario takes."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    from swarmwire.comms.radio.config.phy import Antenna
    from swarmwire.metrics.radio_fit.fit import NetworkFit, RadioFit

DISK = {"range_m": 1.0}  # what a table without path loss is put into


def radio_fit_toml(fit: "RadioFit", antenna: "Antenna", file: Path) -> str:
    """The table `[radio]`, with what was left out as comments.

    BadInput where nothing could be fitted, or where a scenario would refuse what was.
    """
    import tomli_w

    from swarmwire.metrics.radio_fit.tables import parameter_rows, radio_table

    table = radio_table(fit, antenna)
    left_out = [f"{row.parameter}: {row.left_out}" for row in parameter_rows(fit) if row.estimate is None]
    if not table["radio"]:
        raise BadInput(str(file), "", f"nothing could be fitted: {'; '.join(left_out)}")
    comments = [f"Fitted to {file.name} by swarmwire radio fit.", *(f"Left out: {one}." for one in left_out)]
    if "model" not in table["radio"]:
        comments.append("Without path loss this is no radio yet: put it into one that has a model or a range_m.")
    _refuse_unfit(table, file)
    return "".join(f"# {comment}\n" for comment in comments) + tomli_w.dumps(table)


def network_fit_toml(fit: "NetworkFit", file: Path) -> str:
    """The table `[radio]` of a network's fit, with what was left out as comments; BadInput as `radio_fit_toml`."""
    import tomli_w

    from swarmwire.metrics.radio_fit.tables import network_comments, network_rows, network_table

    table = network_table(fit)
    left_out = [f"{row.parameter}: {row.left_out}" for row in network_rows(fit) if row.estimate is None]
    if not table["radio"]:
        raise BadInput(str(file), "", f"nothing could be fitted: {'; '.join(left_out)}")
    _refuse_unfit(table, file)
    comments = [f"Fitted to {file.name} by swarmwire radio fit.", *(f"Left out: {one}." for one in left_out)]
    return "".join(f"# {comment}\n" for comment in [*comments, *network_comments(fit)]) + tomli_w.dumps(table)


def _refuse_unfit(table: dict[str, Any], file: Path) -> None:
    from swarmwire.deploy.radio.around import checked_radio

    whole = table["radio"] if "model" in table["radio"] else {**DISK, **table["radio"]}
    try:
        checked_radio(whole, str(file))
    except BadInput as error:
        raise BadInput(str(file), f"fitted {error.key}", f"{error.expected}, which no scenario takes") from None
