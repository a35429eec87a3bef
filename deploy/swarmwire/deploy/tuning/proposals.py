"""Which parameters to try next: a batch at a time, a function of the trials before it and of nothing else.

The sampler begins each batch afresh, with a seed of its own, in a study in memory that holds the trials before the
batch in their order. So it matters neither which trial was over first, nor how often the tuning was ended and gone on
with, nor how many workers there are.
"""

from collections.abc import Sequence
from typing import Literal, cast

import optuna
from optuna.samplers import BaseSampler, RandomSampler, TPESampler
from optuna.trial import FrozenTrial

from swarmwire.comms.draws import LOW32, derive_key
from swarmwire.deploy.tuning.quietly import quietly
from swarmwire.deploy.tuning.search import Parameter
from swarmwire.deploy.tuning.space import direction_of, space_of
from swarmwire.deploy.tuning.tuning import Tuning


def proposals(tuning: Tuning, before: Sequence[FrozenTrial]) -> list[dict[str, Parameter]]:
    """The parameters of the batch that follows these trials, all of which are over."""
    with quietly():
        direction = cast("Literal['minimize', 'maximize']", direction_of(tuning.goal))
        study = optuna.create_study(direction=direction, sampler=_sampler(tuning, len(before)))
    study.add_trials(before)
    space = dict(space_of(tuning.searches))
    return [dict(study.ask(space).params) for _ in range(tuning.batch)]


def _sampler(tuning: Tuning, first: int) -> BaseSampler:
    """The sampler of the batch whose first trial has this number."""
    seed = derive_key("tuning", tuning.sampler_seed, first) & LOW32
    if tuning.sampler == "random":
        return RandomSampler(seed=seed)
    # Trials of a batch know nothing of each other's values: they are taken for bad, so that they keep apart.
    return TPESampler(seed=seed, constant_liar=True)
