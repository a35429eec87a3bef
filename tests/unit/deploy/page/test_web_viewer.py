"""Rerun's viewer for browsers: who may load it and its recording, and what a browser may load with it."""

import asyncio
import threading

import pytest
from fastapi.testclient import TestClient

from swarmwire.deploy.live.page.web_viewer import PAGE, GrowingRecording, viewer_app

PORT = 12345
HOST = f"127.0.0.1:{PORT}"
CODE = {"re_viewer.js": b"let wasm_bindgen", "re_viewer_bg.wasm": b"\0asm"}
PATHS = ["", "run.rrd", *CODE, *sorted(path.name for path in PAGE.iterdir())]


@pytest.fixture
def tape():
    tape = GrowingRecording(100)
    tape.write(b"head")
    tape.write(b"tick")
    tape.close()
    return tape


@pytest.fixture
def client(tape):
    return TestClient(viewer_app(CODE, tape, "secret", PORT), base_url=f"http://{HOST}")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("stranger", [{}, {"Host": f"swarm.example:{PORT}"}, {"Origin": "https://swarm.example"}])
def test_viewer_and_recording_need_token_host_and_origin(client, path, stranger):
    """A website whose name was made to lead to this machine (DNS rebinding) asks under its own name."""
    token = "secret" if stranger else "secrets"
    assert client.get(f"/{token}/{path}", headers=stranger).status_code == 403
    assert client.get(f"/secret/{path}").status_code == 200


def test_viewer_serves_its_page_the_code_and_the_recording(client, tmp_path):
    assert client.get("/secret/").content == (PAGE / "index.html").read_bytes()
    assert {name: client.get(f"/secret/{name}").content for name in CODE} == CODE
    assert client.get("/secret/re_viewer_bg.wasm").headers["content-type"] == "application/wasm"
    assert client.get("/secret/run.rrd").content == b"headtick"
    (tmp_path / "other.rrd").write_bytes(b"RRF2")
    of_file = TestClient(viewer_app(CODE, tmp_path / "other.rrd", "secret", PORT), base_url=f"http://{HOST}")
    assert of_file.get("/secret/run.rrd").content == b"RRF2"


def test_viewer_policy_lets_a_browser_load_and_send_to_this_server_alone(client):
    policy = dict(
        part.split(maxsplit=1) for part in client.get("/secret/").headers["content-security-policy"].split("; ")
    )
    assert policy["default-src"] == "'none'"
    assert policy["connect-src"] == policy["style-src"] == "'self'"
    assert policy["script-src"] == "'self' 'wasm-unsafe-eval'"
    assert policy["frame-ancestors"] == "http://127.0.0.1:* http://localhost:*"


def read(tape, parts):
    """So many parts of the tape."""

    async def some():
        reading = tape.read()
        got = [await anext(reading) for _ in range(parts)]
        await reading.aclose()
        return got

    return asyncio.run(some())


def test_tape_drops_the_oldest_parts_but_for_the_constants():
    tape = GrowingRecording(2)
    for part in (b"head", b"1", b"2", b"3"):
        tape.write(part)
    assert read(tape, 3) == [b"head", b"2", b"3"]
    tape.write(b"long")  # beyond the limit by itself
    assert read(tape, 1) == [b"head"]


def test_tape_readers_wait_for_parts_and_end_when_it_is_closed():
    tape = GrowingRecording(100)

    async def all_parts():
        got = []
        async for part in tape.read():
            got.append(part)
            if part == b"head":
                threading.Thread(target=tape.write, args=(b"tick",)).start()
            else:
                threading.Thread(target=tape.close).start()
        return got

    async def both():
        readers = [asyncio.create_task(all_parts()) for _ in range(2)]
        await asyncio.sleep(0)  # both wait
        tape.write(b"head")
        return await asyncio.gather(*readers)

    first, second = asyncio.run(both())
    assert first[:2] == second[:2] == [b"head", b"tick"]


def test_tape_leaves_out_what_was_dropped_before_a_slow_reader_came_to_it():
    tape = GrowingRecording(2)

    async def slow():
        reading = tape.read()
        tape.write(b"head")
        got = [await anext(reading)]
        for part in (b"1", b"2", b"3"):
            tape.write(part)
        got += [await anext(reading) for _ in range(2)]
        tape.write(b"4")
        got.append(await anext(reading))
        await reading.aclose()
        return got

    assert asyncio.run(slow()) == [b"head", b"2", b"3", b"4"]
