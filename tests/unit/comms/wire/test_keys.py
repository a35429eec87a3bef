"""Keys name the run and the runner, and lead back to the runner."""

from swarmwire.comms.wire.keys import EVERY_WORLD, Keys, ObserverKeys, run_of, runner_of


def test_a_key_of_a_runner_leads_back_to_it():
    keys = Keys("run-1")
    of_runner = (keys.offer, keys.join, keys.alive, keys.frame, keys.answer)
    assert {runner_of(key("flock-3")) for key in of_runner} == {"flock-3"}


def test_a_world_s_token_leads_back_to_its_run():
    assert run_of(Keys("run-1").world) == "run-1"
    assert Keys("*").world == EVERY_WORLD


def test_no_key_is_of_two_runs_or_of_runners_and_observers():
    of_runners = {key for run in ("a", "b") for key in vars(Keys(run)).values()}
    of_observers = {key for run in ("a", "b") for key in vars(ObserverKeys(run)).values()}
    assert len(of_runners) == 2 * len(vars(Keys("a")))
    assert len(of_observers) == 2 * len(vars(ObserverKeys("a")))
    assert not of_runners & of_observers
