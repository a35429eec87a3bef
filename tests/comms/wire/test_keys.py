"""Keys name the run and the runner, and lead back to the runner."""

from swarmwire.comms.wire.keys import Keys, ObserverKeys, runner_of


def test_a_key_of_a_runner_leads_back_to_it():
    keys = Keys("run-1")
    assert {runner_of(keys.answer("flock-3")), runner_of(keys.alive("flock-3"))} == {"flock-3"}


def test_no_key_is_of_two_runs_or_of_runners_and_observers():
    of_runners = {key for run in ("a", "b") for key in vars(Keys(run)).values()}
    of_observers = {key for run in ("a", "b") for key in vars(ObserverKeys(run)).values()}
    assert len(of_runners) == 2 * len(vars(Keys("a")))
    assert len(of_observers) == 2 * len(vars(ObserverKeys("a")))
    assert not of_runners & of_observers
