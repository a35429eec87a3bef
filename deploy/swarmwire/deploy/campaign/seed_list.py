"""Seeds as people write them."""

from collections.abc import Sequence

from swarmwire.comms.errors import BadInput

MOST_SEEDS = 1_000_000
LARGEST = 2**63 - 1
EXPECTED = "expected how many (200: 1 to 200), FIRST:END (END left out), or a list such as 1,5,7"


def seed_list(given: str | int | Sequence[int], said: str = "--seeds") -> tuple[int, ...]:
    """The seeds: 1 to a number, FIRST:END, or a list; BadInput names `said` unless they are different and 0 or more."""
    try:
        seeds = _range_of(given) if isinstance(given, str | int) else list(given)
    except ValueError:
        raise BadInput(said, "", f"{EXPECTED}; got {given!r}") from None
    if not 0 < len(seeds) <= MOST_SEEDS:
        raise BadInput(said, "", f"{EXPECTED}: 1 to {MOST_SEEDS} of them; got {given!r}")
    good = all(type(seed) is int and 0 <= seed <= LARGEST for seed in (seeds[0], *seeds))
    if not good or (not isinstance(seeds, range) and len(set(seeds)) < len(seeds)):
        raise BadInput(said, "", f"expected different whole numbers from 0 to {LARGEST}; got {given!r}")
    return tuple(seeds)


def chosen_seeds(given: str | Sequence[int], said: str) -> tuple[int, ...]:
    """Some seeds of many: as `seed_list`, but a number alone is that seed."""
    return seed_list(f"{given}," if isinstance(given, str) and given.strip().isdecimal() else given, said)


def _range_of(given: str | int) -> range | list[int]:
    if isinstance(given, int) or given.strip().isdecimal():
        return range(1, min(int(given), MOST_SEEDS + 1) + 1)
    first, colon, end = given.partition(":")
    if colon:
        return range(int(first), min(int(end), int(first) + MOST_SEEDS + 1))
    return [int(part) for part in given.split(",") if part.strip()]
