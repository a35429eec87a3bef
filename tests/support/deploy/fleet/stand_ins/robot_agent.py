"""In the place of `swarmwire.agent.cli` on a fake robot: checks its settings, waits to be stopped, leaves a log."""

import json
import os
import signal
import sys
import tomllib
from pathlib import Path


def main(arguments: list[str]) -> int:
    command, config = arguments[0], Path(arguments[2]).resolve()
    settings = tomllib.loads(config.read_text())
    log = config.parent / settings["log"]
    if command == "check":
        source = (config.parent / settings["agent"].partition(":")[0]).read_text()
        if "stumbles on robots" in source:
            sys.stderr.write("Traceback\nImportError: it stumbles\n")
            return 2
        if "lacks a package on robots" in source:
            sys.stderr.write("ModuleNotFoundError: No module named 'scipy.spatial'\n")
            return 2
        print(settings["name"], "is good", os.environ["PYTHONPATH"])
    elif command == "run":
        run = log / f"{settings['name']}-20261121T120000Z"
        run.mkdir(parents=True, exist_ok=True)
        (run / "robot.json").write_text(json.dumps({"release": config.parent.name}))
        status = {"state": "running", "tick": 42, "late_ticks": 1, "charge": 0.5}
        (log / f"{settings['name']}-status.json").write_text(json.dumps(status))
        print("it runs", flush=True)
        Path(os.environ["READY"]).touch()  # instead of a datagram to systemd
        signal.sigwait([signal.SIGTERM])
    elif command == "stop-motors":
        with (log / "stopped").open("a") as file:
            file.write("stopped\n")
    return 0


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    sys.exit(main(sys.argv[1:]))
