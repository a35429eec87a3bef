"""A world and its runner meet at a unix socket, and nowhere else."""

import pytest
import zenoh

from swarmwire.comms.wire.sessions import open_runner, open_world, unix_endpoint


def test_a_runner_asks_the_world_at_its_socket_and_is_answered(tmp_path):
    endpoint = unix_endpoint(f"{tmp_path}/world")

    def answer(query: zenoh.Query) -> None:
        query.reply("here", b"yes")

    with open_world(endpoint, runner_timeout_s=10.0) as world, open_runner(endpoint) as runner:
        asked = world.declare_queryable("here", answer)
        replies = [reply.ok.payload.to_bytes() for reply in runner.get("here", timeout=10.0) if reply.ok]
        asked.undeclare()
    assert replies == [b"yes"]


def test_nobody_answers_where_there_is_no_world(tmp_path):
    with pytest.raises(zenoh.ZError):
        open_runner(unix_endpoint(f"{tmp_path}/nobody"), connect_s=0.1)
