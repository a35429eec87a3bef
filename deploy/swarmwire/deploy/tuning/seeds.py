"""Seeds on which the best parameters are checked: none of those on which they were found."""

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.arguments import LARGEST_SEED, seed_list

OPTION = "--check-seeds"


def fresh_seeds(given: str, used: tuple[int, ...]) -> tuple[int, ...]:
    """So many seeds after the largest that was used, or those listed; BadInput unless they are all fresh."""
    seeds = seed_list(given, OPTION)
    if given.strip().isdecimal():
        first = max(used) + 1
        if first + len(seeds) - 1 > LARGEST_SEED:
            raise BadInput(OPTION, "", "expected FIRST:END or a list: there are too few above the tuning's seeds")
        return tuple(range(first, first + len(seeds)))
    common = sorted(set(seeds) & set(used))
    if common:
        raise BadInput(OPTION, "", f"expected other seeds than those of the trials; {common[0]} is among both")
    return seeds
