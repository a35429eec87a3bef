"""Key expressions on the agents' endpoint, under `swarmwire/{run}/`."""


class Keys:
    """The keys of one run."""

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
