"""Names in the robots' network: parts of keys, common names of certificates, and names of files."""

import re

LONGEST = 63  # of a part of a host's name, as which a certificate has it; a common name may have 64
WANTED = f"expected 1 to {LONGEST} letters (a to z), digits, - and _ that start with a letter and do not end in -"
_NAME = re.compile(rf"[A-Za-z](?:[A-Za-z0-9_-]{{0,{LONGEST - 2}}}[A-Za-z0-9_])?")


def fault_of_name(name: str) -> str | None:
    """What was expected instead of this name; None if it is one.

    >>> fault_of_name("flock-3") is None
    True
    >>> fault_of_name("radio/*")
    "expected 1 to 63 letters (a to z), digits, - and _ that start with a letter and do not end in -, got 'radio/*'"
    """
    return None if _NAME.fullmatch(name) else f"{WANTED}, got {name!r}"


# --- Key expressions on the agents' and on the observers' endpoint.


EVERY_WORLD = "swarmwire/*/world"  # liveliness tokens of all runs at an endpoint


class Keys:
    """The keys of one run on the agents' endpoint, under `swarmwire/{run}/`.

    A runner's name is in each key that it asks or speaks at, so that access control can hold it to its own.
    """

    def __init__(self, run: str) -> None:
        self.root = f"swarmwire/{run}"
        self.world = f"{self.root}/world"  # liveliness token of the world
        self.any_offer = f"{self.root}/offer/*"
        self.any_join = f"{self.root}/join/*"
        self.any_answer = f"{self.root}/answer/*"
        self.any_alive = f"{self.root}/alive/*"

    def offer(self, runner: str) -> str:
        """Queryable: a runner asks what there is to play."""
        return f"{self.root}/offer/{runner}"

    def join(self, runner: str) -> str:
        """Queryable: a runner asks for robots and gets them."""
        return f"{self.root}/join/{runner}"

    def frame(self, runner: str) -> str:
        """World to runner, one frame a tick."""
        return f"{self.root}/frame/{runner}"

    def answer(self, runner: str) -> str:
        """Runner to world, one answer a frame."""
        return f"{self.root}/answer/{runner}"

    def alive(self, runner: str) -> str:
        """Liveliness token of a runner."""
        return f"{self.root}/alive/{runner}"


def runner_of(key: str) -> str:
    """The runner that a key names at its end."""
    return key.rsplit("/", 1)[-1]


def run_of(world: str) -> str:
    """The run whose world's token this key is."""
    return world.split("/")[1]


class ObserverKeys:
    """The keys of one run on the observers' endpoint, under `swarmwire/{run}/`."""

    def __init__(self, run: str) -> None:
        root = f"swarmwire/{run}"
        self.published = f"{root}/published"  # liveliness token: the run goes on and can be looked at
        self.scene = f"{root}/scene"  # queryable: what does not change
        self.truth = f"{root}/truth"  # glimpses, so many a second at most; may be lost
        self.status = f"{root}/status"  # queryable: how it goes, for whoever may look
        self.control = f"{root}/control"  # queryable: what to do, for whoever may control
