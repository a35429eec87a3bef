"""Whether a worker of a cluster may do runs of a campaign: with the same versions and code; of which CPU, is told."""

from collections.abc import Mapping
from typing import Any

from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests


class Fitness:
    """What workers are held against: this process."""

    def __init__(self) -> None:
        self._versions, self._modules = machine.versions(), module_digests(())
        self._cpus = {machine.cpu()}

    def fault(self, card: Mapping[str, Any]) -> str:
        """What of a worker is not as here, in words; "" if nothing that matters."""
        for name, here in self._versions.items():
            if card["versions"].get(name) != here:
                return f"{name} is {card['versions'].get(name, 'not there')}; here it is {here}"
        return code_fault(self._modules, card["modules"])

    def warning(self, card: Mapping[str, Any]) -> str:
        """What people should know of a worker that is fit; "" if nothing, or if it was told of another worker."""
        if card["cpu"] in self._cpus:
            return ""
        self._cpus.add(card["cpu"])
        return f"another CPU: {card['cpu']}: runs are the same bit for bit on one type of CPU alone (machine_cpu says)"


def code_fault(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Which module has other source there than here, in words; "" if none has."""
    other = next((module for module, digest in here.items() if there.get(module) != digest), None)
    return f"its module {other} is another version than here" if other else ""
