"""`swarmwire kernels`: short runs that compile for the portable CPU, and archives of compiled functions."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.kernel_archive import read_archive, write_archive
from swarmwire.comms.base.kernels import PORTABLE_CPU, PORTABLE_VARIABLES, missing_cpu_features
from swarmwire.deploy.cli.actions.new import new_swarm
from swarmwire.deploy.terminal.output import echo

SHORT = "duration_s=2"


def build_kernels(scenarios: Sequence[Path]) -> None:
    """Run two seconds of each scenario in a process that compiles for the portable CPU; BadInput on an older CPU."""
    if lacking := missing_cpu_features():
        raise BadInput("build", "", f"expected a processor that has {', '.join(lacking)}, as {PORTABLE_CPU}")
    with TemporaryDirectory() as folder:
        chosen = scenarios or [new_swarm(Path(folder, "swarm"))[0].parent]
        for number, scenario in enumerate(chosen):
            name = str(scenario) if scenarios else "a new swarm"
            echo(f"{name}: compiling for {PORTABLE_CPU}, for a minute or so ...")
            words = ["run", str(scenario), "--set", SHORT, "--quiet", "--out", str(Path(folder, f"run-{number}"))]
            command = [sys.executable, "-m", "swarmwire.deploy", *words]
            done = subprocess.run(command, check=False, env=os.environ | PORTABLE_VARIABLES, stdout=subprocess.DEVNULL)
            if done.returncode:
                raise SwarmwireError(f"{name}: the run failed, so its functions are not all compiled")


def export_kernels(archive: Path) -> None:
    """Write the archive; BadInput if nothing is compiled, or the file cannot be written."""
    try:
        count = write_archive(archive)
    except OSError as error:
        raise BadInput(str(archive), "", f"expected a file that can be written: {error.strerror}") from error
    if not count:
        archive.unlink()
        raise BadInput(str(archive), "", "nothing is compiled for other machines; first: swarmwire kernels build")
    echo(f"written: {archive} ({count} compiled functions, {archive.stat().st_size / 1e6:.1f} MB)")


def import_kernels(archive: Path) -> None:
    """Add the archive to this machine's cache."""
    echo(f"{archive}: {read_archive(archive)} compiled functions are ready")
