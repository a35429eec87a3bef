"""The mutants of one module tried, for `python -m tests.tools.mutants`: a line of JSON for each."""

import json
import sys

from tests.tools.mutants.groups import COMMS, GROUPS
from tests.tools.mutants.mutations import mutants_of
from tests.tools.mutants.trying import Attempt, attempts


def _tell(attempt: Attempt) -> None:
    mutant = attempt.mutant
    told = {"line": mutant.line, "before": mutant.before, "after": mutant.after}
    print(json.dumps({**told, "killed": attempt.killed, "took_s": attempt.took_s}), flush=True)


if __name__ == "__main__":
    name, each = sys.argv[1:]
    [tests] = [group[name] for group in GROUPS.values() if name in group]
    attempts(COMMS + name, mutants_of(COMMS + name, int(each)), tests, _tell)
