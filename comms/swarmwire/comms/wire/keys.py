"""Key expressions on the agents' and on the observers' endpoint."""


class Keys:
    """The keys of one run on the agents' endpoint, under `swarmwire/{run}/`."""

    def __init__(self, run: str) -> None:
        self.root = f"swarmwire/{run}"
        self.join = f"{self.root}/join"  # queryable: a runner asks for robots and gets them
        self.world = f"{self.root}/world"  # liveliness token of the world
        self.any_answer = f"{self.root}/answer/*"
        self.any_alive = f"{self.root}/alive/*"

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
    """The runner that an `answer` or `alive` key names."""
    return key.rsplit("/", 1)[-1]


class ObserverKeys:
    """The keys of one run on the observers' endpoint, under `swarmwire/{run}/`."""

    def __init__(self, run: str) -> None:
        root = f"swarmwire/{run}"
        self.published = f"{root}/published"  # liveliness token: the run goes on and can be looked at
        self.scene = f"{root}/scene"  # queryable: what does not change
        self.truth = f"{root}/truth"  # glimpses, so many a second at most; may be lost
        self.status = f"{root}/status"  # queryable: how it goes, for whoever may look
        self.control = f"{root}/control"  # queryable: what to do, for whoever may control
