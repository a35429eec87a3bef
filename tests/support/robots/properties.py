"""Settings of properties that are tried on one rig, example after example."""

from hypothesis import HealthCheck, Phase, settings

ON_ONE_RIG = settings(
    max_examples=60,
    phases=[Phase.explicit, Phase.generate],  # a reading that does not come is waited for: to shrink it takes minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
