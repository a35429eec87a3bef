"""`swarmwire list` and `describe`: names that scenarios and agents can use."""

from swarmwire.deploy.cli.catalogue.kinds import find, kind_named, print_entry, print_kinds, print_list
from swarmwire.deploy.terminal.console import TerminalConsole


def list_names(kind: str | None) -> None:
    """Print all names of a kind, or all kinds."""
    console = TerminalConsole()
    if kind:
        print_list(kind_named(kind), console)
    else:
        print_kinds(console)


def describe_name(name: str) -> None:
    """Print the description of a name."""
    print_entry(find(name), TerminalConsole())
