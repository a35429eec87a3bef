import polars as pl

from docs.experiments.experiment import LAYOUT, find_experiment

NAME = "robots.team.program.3"
BEGIN = {"run": 0, "point": 0, NAME: "udp", "radio.loss": 0.0, "ended": "duration", "error": None}
STATE = {
    "topic": "state",
    "latency_p50_ms": 4.0,
    "latency_p95_ms": 40.0,
    "latency_p99_ms": 80.0,
    "age_mean_s": 0.1,
    "age_p95_s": 0.2,
    "pairs": 56,
    "discovered": 28,
    "discovery_p50_s": 1.0,
    "discovery_max_s": 2.0,
    "cut_pairs": 30,
    "recovery_p50_s": None,
    "recovery_max_s": None,
    "delivery_before": 0.5,
    "delivery_within": 1.0,
    "delivery_across": 0.0,
    "delivery_after": 0.9,
    "frames_per_s": 800.0,
    "kB_per_s": 300.0,
    "airtime": 0.1,
    "out_of_range_share": 0.1,
    "lost_share": 0.0,
    "collided_share": 0.01,
    "late": 0.004,
    "sent_late_p99_ms": 10.0,
    "closings": 0,
}


def numbers_of(rows):
    return find_experiment("middleware", LAYOUT).numbers({"middleware": pl.DataFrame(rows, infer_schema_length=None)})


def test_numbers_are_medians_over_seeds_where_a_missing_time_is_later_than_any_other():
    seeds = [
        BEGIN | STATE | {"seed": seed, "recovery_p50_s": recovery_s} for seed, recovery_s in enumerate([3.0, None, 7.0])
    ]
    failed = BEGIN | {"seed": 4, "ended": "failed", "error": "late: 2.0% of its frames"}
    text = numbers_of([*seeds, failed])
    assert "3 runs count, 3 seeds of each point. 1 failed, 1 of them since they were late." in text.replace("\n", " ")
    (row,) = [line for line in text.splitlines() if line.startswith("| udp") and "7.0" in line]
    assert row.split(" | ")[3:9] == ["0.50", "1.0", "2.0", "1.00", "7.0", "–"]


def test_numbers_have_the_interval_of_a_median_from_order_statistics():
    # Of 20 values the 6th and the 15th: 2 P(Bin(20, 1/2) < 6) = 0.0414 (H. A. David, Order Statistics, table of 2.3).
    def numbers_of_times(times_s):
        return numbers_of([BEGIN | STATE | {"seed": seed, "recovery_p50_s": at_s} for seed, at_s in enumerate(times_s)])

    assert "| 10.5 (6.0 to 15.0) |" in numbers_of_times([float(k) for k in range(1, 21)])
    assert "| 10.5 (6.0 to –) |" in numbers_of_times([*(float(k) for k in range(1, 13)), *[None] * 8])


def test_numbers_count_the_runs_in_which_zenoh_closed_a_transport():
    rows = [
        BEGIN | STATE | {NAME: name, "seed": seed, "closings": closings}
        for name, seed, closings in (("udp", 1, 0), ("zenoh-peer", 1, 0), ("zenoh-peer", 2, 3))
    ]
    assert "1 of 2 runs of zenoh-peer." in numbers_of(rows)


def test_numbers_pair_runs_with_the_same_seed():
    rows = [
        BEGIN | STATE | {NAME: name, "seed": seed, "age_mean_s": 10.0 * seed + age_s}
        for name, ages_s in (("dds", [1.0, 2.0, 3.0]), ("zenoh-peer", [1.5, 4.0, 2.0]))
        for seed, age_s in enumerate(ages_s)
    ]
    assert "| H1 | zenoh-peer - dds, age of states, s | 0 | 3 | 2 | 0.50 |" in numbers_of(rows)


def test_numbers_of_conditions_leave_out_recovery_where_nobody_was_cut_off():
    def campaign(*rows):
        return pl.DataFrame([BEGIN | STATE | row for row in rows], infer_schema_length=None)

    experiment = find_experiment("middleware-conditions", LAYOUT)
    runs = {name: campaign({"seed": 1}) for name in experiment.campaigns}
    runs["middleware-4"] = campaign(
        *({"seed": seed, "recovery_p50_s": at_s, "cut_pairs": cut} for seed, at_s, cut in ((1, 2.0, 6), (2, None, 0)))
    )
    text = experiment.numbers(runs)
    (row,) = [line for line in text.splitlines() if line.startswith("| robots 4 | udp |")]
    assert " 2.0 " in row
    assert "| 2 |" in row
