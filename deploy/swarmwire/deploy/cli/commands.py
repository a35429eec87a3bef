"""The list of all commands, as `swarmwire --help` prints it without the import of any command."""

from typing import NamedTuple

RUN, VIEW, EXPERIMENTS = "Run", "View", "Experiments"
NETWORK, ROBOTS, INSPECT = "Network", "Robots", "Inspect"


class CommandEntry(NamedTuple):
    """A command in the list of all commands."""

    panel: str  # heading in the help
    function: str  # "module:function" in this package, or the Typer app of a group of commands
    help: str  # first paragraph of the command's help


COMMANDS = {
    "new": CommandEntry(
        RUN,
        "inspect:new_command",
        "Create a swarm's folder: an agent, a scenario with a lossy radio, a passing test, and a README.",
    ),
    "import": CommandEntry(
        RUN,
        "inspect:import_command",
        "Make a scenario, and the skeleton of its agents, from an ARGoS experiment; list what has no counterpart.",
    ),
    "run": CommandEntry(
        RUN,
        "run:run_command",
        "Run a scenario, show its progress, and write a run folder: summary, tables, recording, log.",
    ),
    "test": CommandEntry(
        RUN,
        "inspect:run_tests_command",
        "Run the tests of a swarm by pytest, in swarmwire's own environment.",
    ),
    "repeat": CommandEntry(
        RUN,
        "run:repeat_command",
        "Repeat a run from its folder alone, and check whether the result is the same, bit for bit.",
    ),
    "exec": CommandEntry(
        RUN,
        "run:exec_command",
        "Run a command on a robot of a running simulation: in its network namespace, for no longer than the run.",
    ),
    "view": CommandEntry(
        VIEW,
        "view:view_command",
        "Show a run: live, or its recording afterwards. Ctrl-C, or closing the window, ends the view.",
    ),
    "ui": CommandEntry(
        VIEW, "view:ui_command", "Open the page of a live run: watch, pause and step it, inject and clear faults."
    ),
    "export": CommandEntry(
        VIEW,
        "export:export_command",
        "Export a run as a picture, film, capture of its radio, recording, table or motion trace, by its suffix.",
    ),
    "draw": CommandEntry(
        VIEW,
        "export:draw_command",
        "Draw a scenario as it starts, or a body with its sensors, without running anything.",
    ),
    "sweep": CommandEntry(
        EXPERIMENTS,
        "sweep:sweep_command",
        "Run a scenario at many points with many seeds, on all cores: a campaign, with a table of all runs.",
    ),
    "tune": CommandEntry(
        EXPERIMENTS,
        "sweep:tune_command",
        "Search the parameters of a scenario with which a response over many seeds is best.",
    ),
    "compare": CommandEntry(
        EXPERIMENTS,
        "compare:compare_command",
        "Compare two campaigns: medians, their difference and its interval, at each common design point.",
    ),
    "expect": CommandEntry(
        EXPERIMENTS,
        "compare:expect_command",
        "Check that a run or a campaign meets expectations: a line each, and exit code 1 if one is not met.",
    ),
    "report": CommandEntry(
        EXPERIMENTS,
        "compare:report_command",
        "Make a report of a campaign or of a run: one page that needs nothing else, and its figures (SVG, PDF) "
        "beside it.",
    ),
    "world": CommandEntry(
        NETWORK,
        "world:world_command",
        "Run a scenario with remote agents: wait for them, and print the command that starts them.",
    ),
    "join": CommandEntry(NETWORK, "world:join_command", "Run robots' agents for a run that `swarmwire world` serves."),
    "router": CommandEntry(
        NETWORK, "router:router_command", "Forward messages between runners and a world that cannot reach each other."
    ),
    "sim-to-real": CommandEntry(
        ROBOTS,
        "compare:sim_to_real_command",
        "Compare a log of real robots with simulated runs: the same metrics side by side, and their differences.",
    ),
    "check": CommandEntry(
        INSPECT,
        "inspect:check_command",
        "Check a scenario without running it: keys, values, agents and their needs, and room for robots and obstacles.",
    ),
    "list": CommandEntry(
        INSPECT,
        "inspect:list_command",
        "List the names that a scenario or an agent can use: the kinds, or all names of one kind.",
    ),
    "describe": CommandEntry(
        INSPECT,
        "inspect:describe_command",
        "Describe one name: its purpose, its parameters with unit, default and bounds, and the source of its numbers.",
    ),
    "schema": CommandEntry(
        INSPECT, "inspect:schema_command", "Print the JSON schema of a scenario, for editors and programs."
    ),
    "verify": CommandEntry(
        INSPECT,
        "inspect:verify_command",
        "Check a run folder: read all files, compare them with the summary, and list missing or damaged ones.",
    ),
    "ctl": CommandEntry(
        RUN,
        "ctl_events:ctl_app",
        "Watch and control running simulations: pause, step, speed, and events for their robots and radios.",
    ),
    "kernels": CommandEntry(
        NETWORK,
        "kernels:kernels_app",
        "Compiled functions: make them before the first run, and take them to other machines.",
    ),
    "certs": CommandEntry(
        NETWORK,
        "certs:certs_app",
        "Certificates of a swarm's network: a CA of your own, and one certificate for each member.",
    ),
    "robots": CommandEntry(
        ROBOTS,
        "robots:robots_app",
        "Manage the real robots of a fleet.toml: deploy, start, stop and inspect them in parallel over SSH.",
    ),
    "radio": CommandEntry(
        INSPECT, "radio:radio_app", "Probe an emulated radio without a run, or fit one to logs of real robots."
    ),
}
