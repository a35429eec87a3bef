"""Extras exist under the names that the errors give, and what is missing is named in one line."""

from importlib.metadata import metadata

import pytest

from swarmwire.comms import extras
from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import Extra

ALL = [extra for extra in vars(extras).values() if isinstance(extra, Extra)]


@pytest.mark.parametrize("extra", ALL, ids=lambda extra: extra.requirement)
def test_each_extra_is_one_of_its_distribution(extra: Extra):
    distribution, _, name = extra.requirement.removesuffix("]").partition("[")
    assert name in (metadata(distribution).get_all("Provides-Extra") or [])


def test_what_is_installed_passes_and_what_is_not_is_named_with_the_command():
    Extra("a[b]", ("json",)).need("films")
    with pytest.raises(BadInput, match=r'^films: needs no_module_a and no_module_b: pip install "a\[b\]"$'):
        Extra("a[b]", ("json", "no_module_a", "no_module_b")).need("films")
