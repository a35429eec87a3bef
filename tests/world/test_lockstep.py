"""The hand-shake with runners: every state, and that whatever does not fit is counted and changes nothing."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.errors import AgentFailed, RunnerLost
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import BROADCAST, Heard, Payloads, Sent
from swarmwire.comms.senses import Actions, Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.world.lockstep import Lockstep, Refused
from tests.agent.hosts import GIVES, assignment, group, heard_from, plain, senses

GROUPS = {"flock", "scouts", "lone"}
FLOCK, SCOUTS = [0, 1, 4, 5], [2, 6]  # rows of the two groups; robot 3 and 7 are a third


def parts(owners: dict[int, int]) -> list[Assignment]:
    """One assignment for each slot: which slot owns each row."""
    groups = {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    own: list[Assignment] = []
    for slot in sorted(set(owners.values())):
        rows = {name: [row for row in all_rows if owners[row] == slot] for name, all_rows in groups.items()}
        own.append(assignment(*(group("unused:Agent", mine, name) for name, mine in rows.items() if mine)))
    return own


def two_parts() -> list[Assignment]:
    return parts({row: row // 4 for row in range(8)})


def two() -> Lockstep:
    return Lockstep(two_parts())


def request(runner: Any, version: Any = frames.VERSION) -> bytes:
    return msgpack.packb({"v": version, "runner": runner})


def joined(lockstep: Lockstep, *names: str) -> Lockstep:
    for name in names:
        lockstep.join(request(name))
    return lockstep


def ready(lockstep: Lockstep, *names: str) -> Lockstep:
    for name in names:
        lockstep.answer(name, frames.encode("ready", -1, {}))
    return lockstep


def playing() -> Lockstep:
    return ready(joined(two(), "a", "b"), "a", "b")


def all_senses(tick: int = 0) -> Senses:
    return {"flock": senses(tick, FLOCK), "scouts": senses(tick, SCOUTS), "lone": senses(tick, [3, 7])}


def actions(rows: list[int]) -> Actions:
    row = np.array(rows, np.int64)
    payloads = Payloads.of([bytes([r, r, r]) for r in rows])
    return Actions(
        row, row % 2 == 0, row * 0.1, row * -0.1, row * 0.2, Sent(row, np.full(len(rows), BROADCAST), payloads)
    )


def rows_of(frame: bytes) -> list[int]:
    found, *_ = decode_tick(frames.decode(frame), GIVES, GROUPS)
    return [row for part in found.values() for row in part.rows.tolist()]


def state(lockstep: Lockstep) -> Any:
    slots = [(slot.runner, slot.state, slot.rows.tolist(), id(slot.actions)) for slot in lockstep._slots]
    return slots, sorted(lockstep._by_runner), lockstep._tick


def test_runners_get_robots_in_the_order_in_which_they_join() -> None:
    lockstep = two()
    name, reply = lockstep.join(request("second-named-first"))
    assert name == "second-named-first"
    got = Assignment.from_mapping(msgpack.unpackb(reply))
    assert got.robots_text == "flock-0 … lone-3 (4 robots)"
    assert got.groups[0].keys.tolist() == group("", FLOCK).keys[:2].tolist()
    assert Assignment.from_mapping(msgpack.unpackb(lockstep.join(request("a"))[1])).groups[0].rows.tolist() == [4, 5]
    assert not lockstep.counts()


def test_an_assignment_comes_over_whole() -> None:
    sent = assignment(
        group("a.b:C", [1, 4], params={"x": 1.5, "n": 2, "on": True, "w": "ä"}), group("d:E", [2], "s", "footbot")
    )
    got = Assignment.from_mapping(msgpack.unpackb(msgpack.packb(sent.as_mapping())))
    assert got.as_mapping() == sent.as_mapping()
    assert got.gives == GIVES
    assert got.groups[1].body == sent.groups[1].body
    assert got.groups[0].keys.dtype == np.uint64
    assert Assignment.from_mapping(Assignment((), 10, None).as_mapping()).gives is None


@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"\xc1",
        b"\x91" * 5000,
        msgpack.packb(None),
        msgpack.packb({"runner": "a"}),
        msgpack.packb({"v": frames.VERSION}),
        request("a", version=frames.VERSION + 1),
        request("a", version="1"),
        request(3),
        request(b"a"),
        *(request(name) for name in ("", "a/b", "*", "**", "a*", "$*", "a?b", "a#b", "ä", "a b", "a\n", "x" * 65)),
    ],
    ids=repr,
)
def test_a_bad_request_is_refused_counted_and_changes_nothing(bad: bytes) -> None:
    lockstep = joined(two(), "a")
    before = state(lockstep)
    with pytest.raises(Refused, match="expected a request of version 1"):
        lockstep.join(bad)
    assert state(lockstep) == before
    assert lockstep.counts() == {"bad_join": 1}


def test_a_name_in_use_is_refused() -> None:
    lockstep = joined(two(), "a")
    before = state(lockstep)
    with pytest.raises(Refused, match="in use"):
        lockstep.join(request("a"))
    assert state(lockstep) == before
    assert lockstep.counts() == {"refused_join": 1}


def test_who_comes_too_late_gets_no_robots() -> None:
    lockstep = joined(two(), "a", "b")
    before = state(lockstep)
    with pytest.raises(Refused, match="all robots are taken"):
        lockstep.join(request("c"))
    assert state(lockstep) == before
    assert lockstep.counts() == {"refused_join": 1}


def test_the_first_tick_may_begin_once_all_are_ready() -> None:
    lockstep = two()
    assert lockstep.waiting
    assert lockstep.missing == ("that did not join", "flock-0 … lone-3 (4 robots)")
    joined(lockstep, "a", "b")
    assert lockstep.missing[0] == "a"
    ready(lockstep, "a")
    assert lockstep.waiting
    assert lockstep.missing == ("b", "flock-4 … lone-7 (4 robots)")
    ready(lockstep, "b")
    assert not lockstep.waiting
    assert not lockstep.counts()


def test_a_tick_is_complete_once_all_have_answered() -> None:
    lockstep = playing()
    for tick in range(3):
        out = dict(lockstep.open_tick(tick, all_senses(tick), Heard.none(GIVES)))
        assert list(out) == ["a", "b"]
        assert {frames.decode(data).tick for data in out.values()} == {tick}
        for name in ("a", "b"):
            assert lockstep.waiting
            assert lockstep.missing[0] == name
            lockstep.answer(name, encode_actions(tick, actions(rows_of(out[name]))))
        assert not lockstep.waiting
        assert sorted(lockstep.take().rows.tolist()) == list(range(8))
    assert not lockstep.counts()


def test_answers_in_any_order_give_the_same() -> None:
    taken: list[Any] = []
    for order in (["a", "b"], ["b", "a"]):
        lockstep = playing()
        out = dict(lockstep.open_tick(0, all_senses(), Heard.none(GIVES)))
        for name in order:
            lockstep.answer(name, encode_actions(0, actions(rows_of(out[name]))))
        got = lockstep.take()
        taken.append((got.rows.tolist(), got.sent.sender.tolist(), got.linear_mps.tolist(), got.sent.payloads.row(5)))
    assert taken[0] == taken[1]


def sound(name: str = "a") -> bytes:
    rows = {"a": [0, 1, 2, 3], "b": [4, 5, 6, 7]}[name]
    return encode_actions(4, actions(rows))


@pytest.mark.parametrize(
    ("runner", "data", "name"),
    [
        ("stranger", sound(), "unknown_runner"),
        ("stranger", b"", "unknown_runner"),
        ("stranger", frames.encode("failed", 4, {}, {"robots": "x", "traceback": "y"}), "unknown_runner"),
        ("a", b"", "malformed"),
        ("a", b"\xc1", "malformed"),
        ("a", sound()[:-1], "malformed"),
        ("a", bytes(frames.MOST_BYTES + 1), "oversized"),
        ("a", sound("b"), "malformed"),  # robots of another
        ("a", frames.encode("actions", 4, {}), "malformed"),
        ("a", encode_actions(3, actions([0, 1, 2, 3])), "wrong_tick"),
        ("a", encode_actions(5, actions([0, 1, 2, 3])), "wrong_tick"),
        ("a", frames.encode("ready", -1, {}), "unexpected_kind"),
        ("a", frames.encode("tick", 4, {}), "unexpected_kind"),
        ("a", frames.encode("end", -1, {}), "unexpected_kind"),
        ("b", sound("b"), "wrong_tick"),  # it has answered already
    ],
)
def test_what_does_not_fit_is_counted_by_name_and_changes_nothing(runner: str, data: bytes, name: str) -> None:
    lockstep = playing()
    lockstep.open_tick(4, all_senses(), Heard.none(GIVES))
    lockstep.answer("b", sound("b"))
    before = state(lockstep)
    lockstep.answer(runner, data)
    assert state(lockstep) == before
    assert lockstep.counts() == {f"{name}_frames": 1}
    lockstep.answer("a", sound())
    assert not lockstep.waiting


@pytest.mark.parametrize("kind", ["actions", "ready"])
def test_before_the_first_tick_only_a_first_ready_counts(kind: str) -> None:
    lockstep = joined(two(), "a", "b")
    if kind == "ready":
        ready(lockstep, "a")
    before = state(lockstep)
    lockstep.answer("a", frames.encode(kind, -1, {}))
    assert state(lockstep) == before
    assert lockstep.counts() == {{"ready": "unexpected_kind_frames", "actions": "wrong_tick_frames"}[kind]: 1}


def test_random_answers_never_raise_and_never_count_as_an_answer() -> None:
    lockstep, generator, data = playing(), np.random.default_rng(3), sound()
    lockstep.open_tick(4, all_senses(), Heard.none(GIVES))
    before = state(lockstep)
    for _ in range(1000):
        spoiled = bytearray(data)
        spoiled[int(generator.integers(0, 40))] ^= 1 << int(generator.integers(8))  # in the head of the frame
        lockstep.answer("stranger", bytes(spoiled))
        lockstep.answer("a", generator.bytes(int(generator.integers(0, 50))))
    assert state(lockstep) == before
    assert sum(lockstep.counts().values()) == 2000


@pytest.mark.parametrize("opened", [False, True])
def test_a_failed_agent_ends_the_run_with_its_robots_and_traceback(opened: bool) -> None:
    lockstep = joined(two(), "a", "b")
    if opened:
        ready(lockstep, "a", "b").open_tick(0, all_senses(), Heard.none(GIVES))
    with pytest.raises(AgentFailed) as caught:
        lockstep.answer("b", frames.encode("failed", 0, {}, {"robots": "flock-4", "traceback": "Boom"}))
    assert (caught.value.robots, caught.value.traceback) == ("flock-4", "Boom")


@pytest.mark.parametrize("values", [{}, {"robots": "x"}, {"robots": 1, "traceback": "y"}], ids=repr)
def test_a_failure_without_words_names_the_runners_robots(values: dict[str, Any]) -> None:
    lockstep = joined(two(), "a", "b")
    with pytest.raises(AgentFailed) as caught:
        lockstep.answer("b", frames.encode("failed", 0, {}, values))
    assert caught.value.robots == "flock-4 … lone-7 (4 robots)"


def test_a_lost_runner_ends_the_run_if_it_plays_robots() -> None:
    lockstep = joined(two(), "a", "b")
    before = state(lockstep)
    lockstep.gone("stranger", "its link is gone")
    assert state(lockstep) == before
    with pytest.raises(RunnerLost) as caught:
        lockstep.gone("b", "its link is gone")
    assert (caught.value.runner, caught.value.robots) == ("b", "flock-4 … lone-7 (4 robots)")
    assert caught.value.reason == "its link is gone"


def test_robots_that_do_not_act_are_neither_sent_nor_expected() -> None:
    lockstep = playing()
    some = {"flock": senses(0, [1, 4]), "lone": senses(0, [7])}
    out = dict(lockstep.open_tick(0, some, Heard.none(GIVES)))
    assert {name: rows_of(data) for name, data in out.items()} == {"a": [1], "b": [4, 7]}
    lockstep.answer("b", encode_actions(0, actions([4, 7])))
    lockstep.answer("a", encode_actions(0, actions([1])))
    assert not lockstep.waiting
    assert sorted(lockstep.take().rows.tolist()) == [1, 4, 7]


def test_a_runner_none_of_whose_robots_acts_gets_its_groups_empty_so_that_they_forget() -> None:
    lockstep = playing()
    out = dict(lockstep.open_tick(0, {"flock": senses(0, [4]), "scouts": senses(0, [])}, Heard.none(GIVES)))
    found, *_ = decode_tick(frames.decode(out["a"]), GIVES, GROUPS)
    assert {name: part.rows.tolist() for name, part in found.items()} == {"flock": [], "scouts": []}
    lockstep.answer("a", encode_actions(0, actions([])))
    lockstep.answer("b", encode_actions(0, actions([4])))
    assert lockstep.take().rows.tolist() == [4]


def test_each_runner_gets_the_outcomes_of_its_own_robots_in_their_order():
    lockstep = Lockstep(parts(dict(enumerate([1, 0, 1, 0, 2, 2, 2, 2]))))
    ready(joined(lockstep, "a", "b", "c"), "a", "b", "c")
    told = Outcomes(np.array([0, 1, 1, 2, 3]), np.array([9, 2, 3, 0, 1]), np.array([0, 1, 2, 3, 4]))
    got: dict[str, list[list[int]]] = {}
    for name, frame in lockstep.open_tick(0, all_senses(), Heard.none(GIVES), told):
        _, _, its = decode_tick(frames.decode(frame), GIVES, GROUPS)
        got[name] = [its.row.tolist(), its.id.tolist(), its.result.tolist()]
    assert got == {"a": [[1, 1, 3], [2, 3, 1], [1, 2, 4]], "b": [[0, 2], [9, 0], [0, 3]], "c": [[], [], []]}


owners_ = st.lists(st.integers(0, 3), min_size=8, max_size=8)


@given(owners_, st.lists(st.integers(0, 7), unique=True), st.data())
def test_split_among_runners_and_joined_again_it_is_the_whole(owners: list[int], acting: list[int], data: Any) -> None:
    slots = parts(dict(enumerate(owners)))
    owned = [sorted(row for own in slot.groups for row in own.rows.tolist()) for slot in slots]
    lockstep = Lockstep(slots)
    names = [f"r{i}" for i in range(len(slots))]
    ready(joined(lockstep, *names), *names)
    acting_groups = {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    whole = {name: senses(2, sorted(set(rows) & set(acting))) for name, rows in acting_groups.items()}
    senders = data.draw(st.lists(st.integers(0, 7), max_size=6))
    sent = Sent(
        np.array(senders, np.int64), np.full(len(senders), -1), Payloads.of([bytes([s] * (s + 1)) for s in senders])
    )
    heard = heard_from(sent, data.draw(st.lists(st.integers(0, 7), unique=True).map(sorted)))

    out = lockstep.open_tick(2, whole, heard)
    assert [name for name, _ in out] == names
    seen: dict[int, Any] = {}
    packets: list[Any] = []
    answers: list[tuple[str, bytes]] = []
    for (name, frame), own in zip(out, owned, strict=True):
        got_senses, got, _ = decode_tick(frames.decode(frame), GIVES, GROUPS)
        rows: list[int] = []
        for part_name, part in got_senses.items():
            rows += part.rows.tolist()
            assert part.rows.tolist() == sorted(part.rows.tolist())
            seen |= {
                row: (part_name, [part.fields[f][at].tolist() for f in part.fields])
                for at, row in enumerate(part.rows.tolist())
            }
        assert set(rows) <= set(own)
        assert set(got.receiver.tolist()) <= set(own)
        used = got.payload.tolist()
        assert sorted(set(used)) == list(range(len(got.payloads)))  # each payload that is needed once, no other
        packets += listed(got)
        answers.append((name, encode_actions(2, actions(rows))))
    assert packets == sorted(packets, key=lambda p: owners[p[0]])
    assert sorted(packets) == sorted(listed(heard))
    expected = {
        row: (name, [part.fields[f][at].tolist() for f in part.fields])
        for name, part in whole.items()
        for at, row in enumerate(part.rows.tolist())
    }
    assert seen == expected
    for name, answer in data.draw(st.permutations(answers)):
        lockstep.answer(name, answer)
    assert not lockstep.waiting
    assert not lockstep.counts()
    assert plain(lockstep.take()) == plain(actions(sorted(expected)))


def listed(heard: Heard) -> list[Any]:
    columns = [heard.receiver, heard.sender, heard.sequence, heard.heard_at_ns, *heard.given.values()]
    payloads = [heard.payloads.row(int(p)) for p in heard.payload]
    return list(zip(*(column.tolist() for column in columns), payloads, strict=True))


def test_a_runner_none_of_whose_groups_acts_gets_no_frame_and_is_not_waited_for() -> None:
    lockstep = ready(joined(Lockstep(parts({0: 0, 1: 0, 4: 0, 5: 0, 2: 1, 6: 1, 3: 1, 7: 1})), "a", "b"), "a", "b")
    frames_out = lockstep.open_tick(0, {"flock": senses(0, FLOCK)}, Heard.none(GIVES))
    assert [runner for runner, _ in frames_out] == ["a"]
    assert lockstep.waiting == 1
    lockstep.answer("b", encode_actions(0, actions([])))
    assert lockstep.counts() == {"wrong_tick_frames": 1}
    lockstep.answer("a", encode_actions(0, actions(FLOCK)))
    assert lockstep.waiting == 0
    assert sorted(lockstep.take().rows.tolist()) == FLOCK
    assert lockstep.open_tick(1, {}, Heard.none(GIVES)) == []
    assert lockstep.waiting == 0
    assert len(lockstep.take().rows) == 0


def test_robots_of_a_dead_runner_stand_still_and_nobody_waits_for_them() -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "dead"), "a", "b"), "a", "b")
    lockstep.open_tick(0, all_senses(), Heard.none(GIVES))
    lockstep.gone("b", "its link is gone")
    assert (lockstep.waiting, lockstep.missing[0]) == (1, "a")
    for tick in range(2):
        lockstep.answer("a", encode_actions(tick, actions([0, 1, 2, 3])))
        assert not lockstep.waiting
        got = lockstep.take()
        still = got.rows > 3
        assert sorted(got.rows.tolist()) == list(range(8))
        assert got.drive[still].all()
        assert not got.linear_mps[still].any()
        assert not got.angular_radps[still].any()
        out = lockstep.open_tick(tick + 1, all_senses(tick + 1), Heard.none(GIVES))
        assert [name for name, _ in out] == ["a"]
    assert [loss.runner for loss in lockstep.losses] == ["b"]
    assert lockstep.counts() == {"runners_lost": 1}
    with pytest.raises(Refused, match="all robots are taken"):
        lockstep.join(request("c"))


@pytest.mark.parametrize("answered", [False, True])
def test_whoever_takes_over_gets_the_open_tick_unless_it_was_answered(answered: bool) -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "wait"), "a", "b"), "a", "b")
    out = dict(lockstep.open_tick(0, all_senses(), Heard.none(GIVES)))
    lockstep.answer("a", encode_actions(0, actions([0, 1, 2, 3])))
    if answered:
        lockstep.answer("b", encode_actions(0, actions([4, 5, 6, 7])))
    lockstep.gone("b", "its link is gone")
    lockstep.lose_silent("no answer")  # nobody is there to be silent
    assert (lockstep.waiting, lockstep.missing[0], len(lockstep.losses)) == (1, "that did not join", 1)
    joined(lockstep, "c")
    again = lockstep.answer("c", frames.encode("ready", -1, {}))
    assert again == ([] if answered else [("c", out["b"])])
    if not answered:
        assert lockstep.waiting
        lockstep.answer("c", encode_actions(0, actions([4, 5, 6, 7])))
    assert not lockstep.waiting
    assert plain(lockstep.take()) == plain(actions(list(range(8))))
    assert [name for name, _ in lockstep.open_tick(1, all_senses(1), Heard.none(GIVES))] == ["a", "c"]


@pytest.mark.parametrize("on_loss", ["dead", "wait"])
def test_before_the_first_tick_every_loss_ends_the_run(on_loss: Any) -> None:
    lockstep = joined(Lockstep(two_parts(), on_loss), "a")
    with pytest.raises(RunnerLost):
        lockstep.gone("a", "its link is gone")
    with pytest.raises(RunnerLost, match="no answer"):
        lockstep.lose_silent("no answer")
