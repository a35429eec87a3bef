"""What may become of a packet."""

from reference.markdown import code, sentence, table
from swarmwire.comms.packets import Fate


def fate_table() -> str:
    """Every fate and its meaning."""
    return table(("fate", "meaning"), [(code(fate.name.lower()), sentence(fate.meaning)) for fate in Fate])
