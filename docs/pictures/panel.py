"""Draws docs/panel.svg: the panel of a terminal of 100 x 30 in the middle of a run.

uv run python docs/pictures/panel.py
"""

import io
import re
from pathlib import Path

from rich.console import Console

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy.cli.display.figures import Figures
from swarmwire.deploy.cli.display.panel import panel_view
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.world.scenario_file import load_scenario

DOCS = Path(__file__).parents[1]
SCENARIO = "scenarios/flocking-disrupted.toml"
WIDTH, HEIGHT = 100, 30
AT_TICK = 420
RUNNERS = 4


class Picture(Observer):
    """Observer that draws the panel of one tick and ends the run."""

    def __init__(self, simulation: Simulation, console: Console) -> None:
        self._simulation, self._console = simulation, console
        self._figures = Figures(simulation.plan.ticks, simulation.metrics, WallClock())

    def begin(self, static: Static) -> None:
        """Look on from here."""
        self._figures.begin(static)

    def see(self, truth: Truth) -> None:
        """Draw, if it is the tick."""
        self._figures.see(truth)
        if truth.tick == AT_TICK:
            simulation = self._simulation
            self._console.print(panel_view(self._figures, simulation.controls, simulation.health(), WIDTH))
            simulation.controls.quit()


def main() -> None:
    """Run the scenario up to the tick and write the picture."""
    console = Console(
        record=True, width=WIDTH, height=HEIGHT, file=io.StringIO(), force_terminal=True, color_system="truecolor"
    )
    scenario = load_scenario(DOCS.parent / SCENARIO)
    simulation = Simulation(scenario, runners=RUNNERS)
    simulation.watch(Picture(simulation, console))
    run_to_end(simulation)
    svg = console.export_svg(title=f"swarmwire run {SCENARIO} --runners {RUNNERS}", unique_id="panel")
    # The font would be fetched from the network by whoever looks at the picture.
    (DOCS / "panel.svg").write_text(re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
