"""The page: who may see it, what it shows of a run, and what people ask of the run by it."""

import asyncio
import contextlib
import http.client
import json
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import numpy as np
import pytest
from fastapi.testclient import TestClient

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.run_views import ObservedTick
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.live.page.news import MAX_EVENTS, MAX_HISTORY, MAX_POSITIONS, NewsThread, TickNumbers
from swarmwire.deploy.live.page.server import FILES, PageConstants, page_app
from swarmwire.deploy.live.page.serving import serving
from swarmwire.deploy.live.viewer import AbandonmentDetector
from tests.support.clocks import FakeClock, until
from tests.support.deploy.page import StandIn
from tests.support.metrics.truths import static, tally, truth

pytest.importorskip("fastapi", reason="needs the extra [ui]")


PORT = 12345
HOST = f"127.0.0.1:{PORT}"
SHOWN = PageConstants("http://127.0.0.1:9/token/", {"name": "a flock"})


@pytest.fixture
def control():
    return StandIn()


@pytest.fixture
def news(control):
    thread = NewsThread(control, lambda: {"link_pdr": 0.25}, WallClock())
    yield thread
    thread.close()


@pytest.fixture
def client(control, news):
    with TestClient(page_app(control, news, SHOWN, "secret", PORT), base_url=f"http://{HOST}") as client:
        yield client


@pytest.fixture
def served(control, news):
    """The address of the real server: at a port that the system chose, on loopback."""
    server = serving(lambda token, port: page_app(control, news, SHOWN, token, port), WallClock())
    with server as address, contextlib.closing(news):
        yield address


@pytest.mark.parametrize("file", sorted(path.name for path in FILES.iterdir()))
def test_files_of_the_page_are_served_under_the_token(client, file):
    answer = client.get(f"/secret/{file}")
    assert answer.status_code == 200
    assert answer.content == (FILES / file).read_bytes()
    assert client.get("/secret/").content == (FILES / "index.html").read_bytes()


@pytest.mark.parametrize("path", ["/", "/status", "/secre/status", "/secrets/", "//secret/status", "/news"])
def test_without_the_token_everything_is_refused(client, path):
    answer = client.get(path)
    assert answer.status_code == 403
    assert "token" in answer.text


def test_request_without_a_path_is_refused(served):
    with contextlib.closing(http.client.HTTPConnection(urlsplit(served).netloc, timeout=10)) as connection:
        connection.request("OPTIONS", "*")
        assert connection.getresponse().status == 403


def test_page_address_without_its_last_slash_is_redirected(client):
    assert client.get("/secret", follow_redirects=False).headers["location"] == "/secret/"


NAMES = ["swarm.example", "127.0.0.1", f"127.0.0.1:{PORT + 1}", f"0.0.0.0:{PORT}", "", f"[::1]:{PORT}"]
SITES = ["https://swarm.example", "null", f"http://{HOST}.swarm.example", f"https://{HOST}"]


@pytest.mark.parametrize(
    ("token", "headers"),
    [
        *((token, {}) for token in ("", "secre", "secrets", "SECRET", "sécret")),
        *(("secret", {"Host": name}) for name in NAMES),
        *(("secret", {"Origin": site}) for site in SITES),
    ],
)
def test_another_token_name_or_site_gives_no_control(client, control, token, headers):
    """A stranger's name may be made to lead to this machine, after which its pages are of the same origin."""
    answer = client.post(f"/{token}/do", json={"do": "stop"}, headers=headers)
    assert (answer.status_code, "another site" in answer.text) == (403, "Origin" in headers)
    assert not control.orders


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_orders_from_the_page_itself_are_accepted(client, control, host):
    own = {"Host": f"{host}:{PORT}", "Origin": f"http://{host}:{PORT}"}
    assert client.post("/secret/do", json={"do": "stop"}, headers=own).status_code == 200
    assert control.orders == [("stop", None)]


def test_answer_headers_forbid_foreign_content_and_embedding(client):
    for answer in (client.get("/secret/"), client.get("/elsewhere")):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "frame-src http://127.0.0.1:9;" in policy
        assert answer.headers["referrer-policy"] == "same-origin"
        assert answer.headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    ("order", "call"),
    [
        ({"do": "pause"}, ("pause", None)),
        ({"do": "resume"}, ("resume", None)),
        ({"do": "step"}, ("step", 1)),
        ({"do": "step", "n": 10}, ("step", 10)),
        ({"do": "speed", "factor": 0.1}, ("speed", 0.1)),
        ({"do": "speed", "factor": None}, ("speed", None)),
        ({"do": "end", "number": 3}, ("end", 3)),
    ],
)
def test_orders_reach_the_run(client, control, order, call):
    answer = client.post("/secret/do", json=order)
    assert (answer.status_code, answer.json()) == (200, {"event": None})
    assert control.orders == [call]


def test_event_is_passed_on_unchanged_and_answered_with_its_number(client, control):
    table = {"do": "kill", "robots": {"names": ["flock-1"]}}
    assert client.post("/secret/do", json={"do": "event", "event": table}).json() == {"event": 7}
    assert control.orders == [("event", table)]


@pytest.mark.parametrize(
    ("order", "key"),
    [
        *((json.dumps(order), "") for order in ({}, [], {"do": "format"})),
        *((json.dumps({"do": "step", "n": n}), "step.n") for n in (0, 1.5)),
        *((json.dumps({"do": "speed", **factor}), "speed.factor") for factor in ({"factor": -1}, {})),
        (json.dumps({"do": "pause", "now": True}), "pause.now"),
        (json.dumps({"do": "event", "event": "kill"}), "event.event"),
        (json.dumps({"do": "end", "number": -1}), "end.number"),
        ('{"do": "speed", "factor": NaN}', "speed.factor"),
        ('{"do": "speed", "factor": -Infinity}', "speed.factor"),
        ('{"do": "speed", "factor": 1e999}', "speed.factor"),
        ('{"do": "speed", "factor": "fast"}', "speed.factor"),
        (f'{{"do": "step", "n": {"9" * 100}}}', "step.n"),
        (f'{{"do": "end", "number": {"9" * 100}}}', "end.number"),
        (f'{{"do": "step", "n": {"9" * 5000}}}', ""),
        ('{"do": "event", "event": {"do": "kill", "for_s": NaN}}', "event.for_s"),
        ('{"do": "event", "event": {"do": "kill", "robots": {"count": Infinity}}}', "event.robots.count"),
        (f'{{"do": "event", "event": {{"do": "kill", "for_s": {"9" * 100}}}}}', "event.for_s"),
        (f'{{"do": "event", "event": {"[" * 30_000}{"]" * 30_000}}}', ""),
        ("[" * 60_000, ""),
        ('{"do": "pause"', ""),
        ("", ""),
        (b"\xff\xfe", ""),
    ],
)
def test_order_of_other_json_is_refused_in_one_line_with_its_key(client, control, order, key):
    answer = client.post("/secret/do", content=order, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    line = answer.json()["detail"]
    assert line.startswith(key)
    assert line.isprintable()
    assert len(line) < 300
    assert not control.orders


def test_refusal_of_the_run_is_passed_on_in_its_own_line(client, control):
    answer = client.post("/secret/do", json={"do": "event", "event": {"do": "dance"}})
    assert (answer.status_code, answer.json()) == (409, {"detail": "do: expected something that can happen"})


def test_order_that_is_too_long_is_refused(client, control):
    answer = client.post("/secret/do", json={"do": "event", "event": {"do": "kill", "why": "x" * 100_000}})
    assert answer.status_code == 413
    assert not control.orders


def test_status_joins_the_last_answer_of_the_run_and_what_was_seen(client, control, news):
    assert client.get("/secret/status").json() == {}
    news.start()
    until(lambda: client.get("/secret/status").json().get("tick") == 0)
    control.tick = 3
    news.look()
    answer = until(lambda: client.get("/secret/status").json(), lambda answer: answer["tick"] == 3)
    assert answer["link_pdr"] == 0.25
    assert answer["metrics"] == {"order": 0.5, "rejoin_median": None}


def test_values_are_kept_for_pages_that_are_opened_later_one_a_tick(control, news):
    for tick in range(MAX_HISTORY + 5):
        control.tick = tick
        for _ in range(2):  # the second tells of no other tick
            news._publish(control.status())
    assert len(news.history) == MAX_HISTORY
    assert news.history[-1] == {"link_pdr": 0.25, "alive": 3, "tick_ms": 1.5, "order": 0.5, "rejoin_median": None}


def events(answer):
    """The events of a stream as they come: their name and what they say."""
    name = None
    for line in answer:
        text = line.decode().strip()
        if text.startswith("event: "):
            name = text.removeprefix("event: ")
        if text.startswith("data: "):
            yield name, json.loads(text.removeprefix("data: "))


def test_news_reach_a_page_until_the_run_is_gone(control, news, served):
    assert served.startswith("http://127.0.0.1:")
    news.start()
    with urllib.request.urlopen(f"{served}news", timeout=20) as answer:
        stream = events(answer)
        name, facts = next(stream)
        assert (name, facts["name"], facts["viewer"]) == ("facts", "a flock", SHOWN.viewer)
        name, status = next(stream)
        assert (name, status["state"]) == ("status", "running")
        control.gone = True
        over = next(status for _, status in stream if status["state"] == "over")
        assert (over["tick"], over["gone"]) == (0, "nobody answers")
        assert news.readers == 1  # a page that is open is counted also after the end
    until(lambda: news.readers == 0)


def test_frozen_run_is_silent_until_it_answers_again(control):
    news = NewsThread(control, dict, WallClock(), over=lambda: False)
    with contextlib.closing(news):
        news.start()
        for frozen, state in ((False, "running"), (True, "silent"), (False, "running")):
            control.gone = frozen
            until(lambda state=state: news.latest.get("state") == state)


def test_news_unread_by_a_page_are_dropped_but_the_newest(control, news):
    """However long a browser's tab sleeps, it costs the server one status."""

    async def slow() -> list[int]:
        reading = news.read()
        got = []
        for ticks in (1, 50):
            for _ in range(ticks):
                control.tick += 1
                news._publish(control.status())
            got.append((await anext(reading))["tick"])
        await reading.aclose()
        return got

    assert asyncio.run(slow()) == [1, 51]
    assert not news._readers


def test_news_end_for_every_page_when_the_server_ends(news, served):
    news.start()
    with urllib.request.urlopen(f"{served}news", timeout=20) as answer:
        stream = events(answer)
        assert [next(stream)[0], next(stream)[0]] == ["facts", "status"]
        news.close()
        assert [status for _, status in stream if status["state"] != "running"] == []  # it ends


def test_departure_is_that_of_the_last_browser_after_there_was_one():
    clock, readers = FakeClock(), [0]
    departed = AbandonmentDetector(clock, lambda: readers[0])

    def looks(open_pages, for_s):
        readers[0] = open_pages
        counts = [departed()]
        clock.time_ns += round(for_s * 1e9)
        return [*counts, departed()]

    assert looks(0, 1000) == [False, False]  # nobody has opened it yet
    assert looks(2, 1000) == [False, False]
    assert looks(0, 1) == [False, False]  # a page that is loaded anew
    assert looks(1, 1000) == [False, False]
    assert looks(0, 6) == [False, True]


def test_speed_is_unknown_while_kernels_are_compiled(control, news):
    for state, speed in (("running", None), ("compiling", None), ("compiling", None)):
        control.state = state
        news._publish(control.status())
        assert news.latest["speed_now"] is speed


def test_token_differs_for_each_page():
    calls = []

    def app(token, port):
        calls.append((token, port))

    for _ in range(2):
        with serving(app, WallClock()) as address:
            token, port = calls[-1]
            assert address == f"http://127.0.0.1:{port}/{token}/"
            assert len(token) >= 32
    assert calls[0][0] != calls[1][0]
    with pytest.raises(urllib.error.URLError):  # the server ends with its block
        urllib.request.urlopen(f"http://127.0.0.1:{calls[-1][1]}/", timeout=5)


FOUR, NINE = static(robots=4), static(robots=9)


def glimpse(tick=0, run=FOUR, **fields):
    return ObservedTick(truth(run, tick, **fields), serial=tick, ticks=1, values=np.zeros((0, 1)))


def happened(changed, ended=False, serial=2):
    robots = np.zeros(9, np.bool_)
    robots[list(changed)] = True
    return EventRecord(serial, 0.0, "kill", ended, robots)


def test_centre_is_that_of_the_robots_alive():
    tick_numbers = TickNumbers(FOUR)
    assert tick_numbers.numbers["centre"] is None
    pose = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 4.0, 0.0], [9.0, 9.0, 0.0]])
    tick_numbers.see(glimpse(pose=pose, alive=np.array([True, True, True, False])))
    assert tick_numbers.numbers["centre"] == pytest.approx([4 / 3, 4 / 3], abs=1e-3)
    assert tick_numbers.numbers["places"] == [[0, 0, True], [2, 0, True], [2, 4, True], [9, 9, False]]
    tick_numbers.see(glimpse(pose=pose, alive=np.zeros(4, np.bool_)))
    assert tick_numbers.numbers["centre"] is None


def test_positions_shown_of_a_large_swarm_are_limited():
    large = static(robots=3 * MAX_POSITIONS)
    tick_numbers = TickNumbers(large)
    tick_numbers.see(glimpse(run=large))
    assert len(tick_numbers.numbers["places"]) == MAX_POSITIONS


def test_delivery_is_that_of_the_last_simulated_second():
    tick_numbers = TickNumbers(FOUR)
    tick_numbers.see(glimpse(0, tally=tally({Fate.RECEIVED: 1, Fate.LOST: 1})))
    assert tick_numbers.numbers["link_pdr"] == 0.5
    tick_numbers.see(glimpse(5, tally=tally({Fate.RECEIVED: 2})))
    assert tick_numbers.numbers["link_pdr"] == 0.75
    tick_numbers.see(glimpse(10, tally=tally({Fate.LOST: 2})))
    assert tick_numbers.numbers["link_pdr"] == 0.5
    tick_numbers.see(glimpse(30, tally=None))
    assert tick_numbers.numbers["link_pdr"] is None


@pytest.mark.parametrize(
    ("robots", "names"),
    [
        ((), "none"),
        ((1, 3), "flock-1, flock-3"),
        (range(9), "all"),
        (range(1, 9), "flock-1, flock-2, flock-3, flock-4, flock-5 and 3 more"),
    ],
)
def test_events_say_whom_they_changed_when_they_began(robots, names):
    tick_numbers = TickNumbers(NINE)
    tick_numbers.see(glimpse(0, NINE, events=(happened(robots),)))
    tick_numbers.see(glimpse(1, NINE, events=(happened([0], ended=True),)))
    assert tick_numbers.numbers["who"] == {"2": names}


def test_events_kept_are_the_newest():
    tick_numbers = TickNumbers(NINE)
    for tick in range(MAX_EVENTS + 10):
        tick_numbers.see(glimpse(tick, NINE, events=(happened([0], serial=tick),)))
    assert list(tick_numbers.numbers["who"]) == [str(tick) for tick in range(10, MAX_EVENTS + 10)]
