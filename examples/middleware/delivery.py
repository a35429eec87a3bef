"""Delivery, latency and age of what the robots' programs sent, from their logs in a run folder.

    python delivery.py RUN

A message counts as delivered to a robot if it arrived there before the end of the run; what arrives twice counts once.
A state or map that was due while its robot's middleware was not open, or blocked, counts as sent, and is lost.
The age of a robot's information at time t is t less the time of sending of the newest message that it has. All clocks
are that of one machine.
"""

import json
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import BoolArray, FloatArray

TOPICS = {"state": b"s", "map": b"m", "command": b"c"}
RECORD = np.dtype(
    [("at_ns", "<i8"), ("kind", "S1"), ("sender", "u1"), ("receiver", "u1"), ("number", "<u4"), ("sent_ns", "<i8")]
)
ALL = 255
DISCOVERY_S = 8.0  # after the middlewares' start: until then programs find one another, and nothing counts
SETTLED_S = 10.0  # after the end of a split
LAST_S = 2.0  # before the end of the run: what is sent later may still be under way
AGE_STEP_S = 0.01
MS, S = 1e6, 1e9
FATES = ("out_of_range", "lost", "collided")  # of frames, beside those that were received or cut off by the split
STATE_PERIOD_MS = 100.0  # PERIODS_S in node.py


@dataclass(frozen=True)
class Logs:
    """What the programs of a run sent and received.

    Attributes:
        messages: a row per message and robot for which it was meant: topic, sender, receiver, sent_s, and received_s,
            null if it did not arrive; times from the start of the run.
        begin_s: time at which the middlewares of all robots had begun.
        halves: of the split, by robot: true for those on one side of it.
        split_s: begin and end of the split.
        end_s: the end of the run.
    """

    messages: pl.DataFrame
    begin_s: float
    halves: BoolArray
    split_s: tuple[float, float]
    end_s: float


def messages_of(
    sent: np.ndarray[Any, Any], received: Mapping[int, np.ndarray[Any, Any]], start_ns: int
) -> pl.DataFrame:
    """Return `Logs.messages` from records (dtype RECORD), of all robots together and by receiving robot."""
    robots = max(received) + 1
    topics = {kind: topic for topic, kind in TOPICS.items()}
    meant = pl.DataFrame(
        {
            "topic": [topics[kind] for kind in sent["kind"].tolist()],
            "sender": sent["sender"].astype(np.int64),
            "to": sent["receiver"].astype(np.int64),
            "number": sent["number"].astype(np.int64),
            "sent_s": (sent["sent_ns"] - start_ns) / S,
        }
    ).join(pl.DataFrame({"receiver": np.arange(robots)}), how="cross")
    is_meant = pl.col("to").is_in([ALL]) | (pl.col("to") == pl.col("receiver"))
    arrived = pl.concat(
        [
            pl.DataFrame(
                {
                    "sender": records["sender"].astype(np.int64),
                    "number": records["number"].astype(np.int64),
                    "received_s": (records["at_ns"] - start_ns) / S,
                    "receiver": np.full(len(records), robot, np.int64),
                }
            )
            for robot, records in received.items()
        ]
    )
    first = arrived.group_by("sender", "number", "receiver").agg(pl.col("received_s").min())
    return (
        meant.filter(is_meant & (pl.col("sender") != pl.col("receiver")))
        .join(first, on=["sender", "number", "receiver"], how="left")
        .select("topic", "sender", "receiver", "sent_s", "received_s")
        .sort("topic", "sender", "receiver", "sent_s")
    )


def read_logs(run: Path) -> Logs:
    """Read the logs of a run of `two-rooms.toml` or `convoy.toml`."""
    names: list[str] = json.loads((run / "static.json").read_text())["robot_names"]
    folders = [run / "programs" / name for name in names]
    start_ns = min(int((folder / "started").read_text()) for folder in folders)
    begun_ns = max(int((folder / "begun").read_text()) for folder in folders)
    scenario = tomllib.loads((run / "scenario.toml").read_text())
    split, duration_s = scenario["events"][0], float(scenario["duration_s"])
    axis = f"{split['halves']}_m"
    ticks = pl.read_parquet(run / "ticks.parquet", columns=["time_s", axis])
    position_m = ticks.filter(pl.col("time_s") >= split["at_s"] - 1e-6)[axis][0].to_numpy()
    received = {robot: _records(folder / "received.bin") for robot, folder in enumerate(folders)}
    sent = np.concatenate([_records(folder / "sent.bin") for folder in folders])
    messages = messages_of(sent, received, start_ns)
    split_s = split["at_s"], split["at_s"] + split["for_s"]
    return Logs(messages, (begun_ns - start_ns) / S, position_m < 0.0, split_s, duration_s)


def _records(path: Path) -> np.ndarray[Any, Any]:
    """Return the whole records of a file; the program may have been killed in the midst of one."""
    data = path.read_bytes() if path.exists() else b""
    return np.frombuffer(data[: len(data) // RECORD.itemsize * RECORD.itemsize], RECORD)


def age_s(sent_s: FloatArray, received_s: FloatArray, times_s: FloatArray, begin_s: float = 0.0) -> FloatArray:
    """Return the age of a receiver's information at `times_s` (t,), from messages (m,); 0 s old at `begin_s`."""
    order = np.argsort(received_s)
    newest_s = np.maximum.accumulate(np.concatenate([[begin_s], sent_s[order]]))
    return times_s - newest_s[np.searchsorted(received_s[order], times_s, side="right")]


def times_to_first(messages: pl.DataFrame, from_s: float, pairs: int) -> FloatArray:
    """Return for each pair of sender and receiver the time until the first message sent since `from_s`; inf: none."""
    arrived = messages.filter((pl.col("sent_s") >= from_s) & pl.col("received_s").is_not_null())
    first = arrived.group_by("sender", "receiver").agg(pl.col("received_s").min() - from_s)["received_s"].to_numpy()
    return np.sort(np.concatenate([first, np.full(pairs - len(first), np.inf)]))


def results(logs: Logs) -> Iterator[dict[str, Any]]:
    """Yield a row per topic; shares and times are null where nothing was sent or nothing arrived.

    delivery_before, _after: of messages sent in the steady time before and after the split. delivery_within: of those
    sent during the split to robots of the same half. delivery_across: of those sent during it to the other half, which
    arrive after it. latency and age: before the split. discovery: time from the middlewares' start until a pair's first
    message. recovery: time from the end of the split until a cut pair's first message that was sent after it.
    """
    begin_s, end_s = logs.split_s
    steady_s = logs.begin_s + DISCOVERY_S
    side = pl.DataFrame({"receiver": np.arange(len(logs.halves)), "side": logs.halves})
    all_messages = (
        logs.messages.join(side, on="receiver")
        .join(side.rename({"receiver": "sender", "side": "sender_side"}), on="sender")
        .with_columns((pl.col("side") != pl.col("sender_side")).alias("is_cut"))
    )
    times_s = np.arange(steady_s, begin_s, AGE_STEP_S)
    for topic in TOPICS:
        messages = all_messages.filter(pl.col("topic") == topic)
        before = _sent_between(messages, steady_s, begin_s)
        during = _sent_between(messages, begin_s, end_s)
        latency_ms = 1e3 * (before["received_s"] - before["sent_s"]).drop_nulls().to_numpy()
        row: dict[str, Any] = {
            "topic": topic,
            "sent": len(messages),
            "delivery_before": _delivered(before),
            "delivery_within": _delivered(during.filter(~pl.col("is_cut"))),
            "delivery_across": _delivered(during.filter("is_cut")),
            "delivery_after": _delivered(_sent_between(messages, end_s + SETTLED_S, logs.end_s - LAST_S)),
        }
        for percent in (50, 95, 99):
            row[f"latency_p{percent}_ms"] = float(np.percentile(latency_ms, percent)) if len(latency_ms) else None
        pairs = messages.select("sender", "receiver", "is_cut").unique()
        cut = messages.filter("is_cut")
        discovery_s = times_to_first(messages, logs.begin_s, len(pairs))
        recovery_s = times_to_first(cut, end_s, int(pairs["is_cut"].sum()))
        ages_s = [
            age_s(pair["sent_s"].to_numpy(), pair["received_s"].to_numpy(), times_s, logs.begin_s)
            for (_, pair) in messages.group_by("sender", "receiver")
            for pair in (pair.drop_nulls("received_s"),)
        ]
        age_values_s = np.concatenate(ages_s) if ages_s else np.empty(0)
        row |= {
            "age_mean_s": float(age_values_s.mean()) if len(age_values_s) else None,
            "age_p95_s": float(np.percentile(age_values_s, 95)) if len(age_values_s) else None,
            "pairs": len(pairs),
            "discovered": int(np.isfinite(discovery_s).sum()),
            "discovery_p50_s": _middle(discovery_s),
            "discovery_max_s": _finite(discovery_s.max(initial=0.0)),
            "cut_pairs": len(recovery_s),
            "recovered": int(np.isfinite(recovery_s).sum()),
            "recovery_p50_s": _middle(recovery_s),
            "recovery_max_s": _finite(recovery_s.max(initial=0.0)) if len(recovery_s) else None,
        }
        yield row


def _sent_between(messages: pl.DataFrame, from_s: float, until_s: float) -> pl.DataFrame:
    return messages.filter((pl.col("sent_s") >= from_s) & (pl.col("sent_s") < until_s))


def _delivered(messages: pl.DataFrame) -> float | None:
    return messages["received_s"].count() / len(messages) if len(messages) else None  # count() leaves nulls out


def _middle(times_s: FloatArray) -> float | None:
    """Return the lower median of sorted times; None if it is infinite, or there is none."""
    return _finite(times_s[(len(times_s) - 1) // 2]) if len(times_s) else None


def _finite(time_s: float) -> float | None:
    return float(time_s) if np.isfinite(time_s) else None


def sent_late_p99_ms(run: Path) -> float:
    """Return the 99th percentile of how late programs sent states, behind their earliest one.

    States that a program could not send count as in time.
    """
    late_ms: list[FloatArray] = []
    for path in (run / "programs").glob("*/sent.bin"):
        sent = _records(path)
        sent_ms = sent["sent_ns"][sent["kind"] == TOPICS["state"]] / MS
        after_plan_ms = sent_ms - STATE_PERIOD_MS * np.arange(len(sent_ms))
        late_ms.append(after_plan_ms - after_plan_ms.min(initial=np.inf))
    return float(np.percentile(np.concatenate(late_ms), 99))


def radio_use(run: Path) -> dict[str, float]:
    """Return frames and kB that programs sent each second, airtime, and the shares of FATES among all receivers.

    A receiver is each robot for which a frame was meant, on each hop: all others for a broadcast.
    """
    summary = json.loads((run / "summary.json").read_text())
    robots, sim_time_s = pl.read_parquet(run / "radio_robots.parquet"), summary["sim_time_s"]
    sent, radio = summary["interfaces"], summary["radio"]
    return {
        "frames_per_s": sent["sent"] / sim_time_s,
        "kB_per_s": sent["sent_bytes"] / sim_time_s / 1e3,
        "airtime": float(robots["airtime_s"].sum()) / sim_time_s,
        **{f"{fate}_share": radio["fates"][fate] / radio["intended"] for fate in FATES},
    }


def main(run: Path) -> None:
    """Print the results of a run."""
    with pl.Config(tbl_rows=-1, tbl_cols=-1, tbl_hide_dataframe_shape=True, float_precision=3):
        print(
            pl.DataFrame(list(results(read_logs(run)))).transpose(
                include_header=True, header_name="", column_names="topic"
            )
        )
    print(", ".join(f"{name} {value:.3g}" for name, value in radio_use(run).items()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
