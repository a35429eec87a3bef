"""The process `swarmwire`."""

import io
import sys

from swarmwire.comms.wire.ending import end_now


def program() -> None:
    """Run the command line; an emergency stop does not wait for the import of the other commands."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a letter that a terminal lacks must not end a run
            stream.reconfigure(errors="replace")
    code = _emergency_stop(sys.argv[1:])
    if code is None:
        code = _command()
    end_now(code)
    sys.exit(code)


def _emergency_stop(arguments: list[str]) -> int | None:
    if arguments[:2] != ["robots", "estop"]:
        return None
    from swarmwire.deploy.cli.estop import call_estop

    return call_estop(arguments[2:])


def _command() -> int:
    from swarmwire.deploy.cli.app import main
    from swarmwire.deploy.cli.options import FAILED
    from swarmwire.deploy.machine import share_heaps

    share_heaps()  # before any library starts threads
    try:
        main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 0 if ended.code is None else FAILED
    return 0
