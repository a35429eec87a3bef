"""The argument that all commands of this group have."""

from pathlib import Path
from typing import Annotated

import typer

AuthorityFolder = Annotated[Path, typer.Argument(help="The folder of the CA.", metavar="DIR")]
