"""In a browser: paused means that the tick stands still, a step is a tick, and what is broken is seen to break."""

import json
import signal
import urllib.error
import urllib.request

import psutil
import pytest

from tests.support.deploy.commands import LOSSY
from tests.support.deploy.page.browsing import chromium, family, paged
from tests.support.waiting import until

pytest.importorskip("fastapi", reason="needs the extra [ui]")
pytest.importorskip("rerun", reason="needs the extra [view]")

TICKS = """(count) => new Promise((done) => {
  const news = new EventSource("news"), ticks = [];
  news.addEventListener("status", (event) => {
    ticks.push(JSON.parse(event.data).tick);
    if (ticks.length === count) { news.close(); done(ticks); }
  });
})"""


@pytest.fixture
def run(tmp_path):
    with paged(LOSSY, tmp_path / "run", "--no-rrd") as started:
        yield started


def at_tick(page, tick):
    """The page has come to show this tick."""
    page.wait_for_selector(f'#ticks[data-tick="{tick}"]')


def ticks(page):
    """The ticks of the next five looks at the run."""
    return page.evaluate(TICKS, 5)


def status(address):
    """What the page would tell, read without a browser."""
    with urllib.request.urlopen(f"{address}status", timeout=20) as answer:
        return json.load(answer)


def level(page, name):
    return float(page.get_attribute(f"[data-name={name}] dd", "data-value"))


def test_paused_is_paused_and_steps_are_ticks(run):
    _, address = run
    with chromium(address) as page:
        at_tick(page, 1)  # which the page asked for, so that there is something to see
        page.wait_for_selector("#state.paused")  # not at once: until its end a tick is told as running
        assert ticks(page) == [1] * 5
        for _ in range(3):
            page.click("#step")
        at_tick(page, 4)
        assert ticks(page) == [4] * 5
        page.click("#step10")
        at_tick(page, 14)
        page.keyboard.press("s")
        at_tick(page, 15)
        assert ticks(page) == [15] * 5
        page.keyboard.press("+")
        until(lambda: page.inner_text("#speed-now"), lambda told: told == "× 2")
        page.keyboard.press(" ")
        page.wait_for_selector("#state.running")
        until(lambda: int(page.get_attribute("#ticks", "data-tick")), lambda tick: tick > 25)
        page.keyboard.press(" ")
        page.wait_for_selector("#state.paused")
        paused_at = ticks(page)
        assert len(set(paused_at)) == 1
        assert paused_at[0] > 25


def test_loss_slid_to_1_takes_the_network_apart_and_slid_back_it_is_one_again(run):
    _, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        whole = level(page, "components")
        slider = page.locator("#radio-loss")
        slider.focus()
        slider.press("End")
        page.click("#step10")
        at_tick(page, 11)
        assert level(page, "components") == 20 > whole
        assert page.inner_text("#events li >> nth=0").split("\n")[:2] == ["tick 1", "radio.loss = 1.0 by hand"]
        slider.focus()
        slider.press("Home")
        page.click("#step")
        at_tick(page, 12)
        assert level(page, "components") == whole


def test_robots_die_and_act_again_and_halves_part_and_heal(run):
    _, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        page.select_option("#robot", "flock-3")
        page.click("#kill")
        page.wait_for_selector("text=next tick")
        page.click("#step")
        at_tick(page, 2)
        assert level(page, "alive") == 19
        page.wait_for_selector("#events li:has-text('kill: flock-3')")
        page.click("#revive-all")
        page.click("#halve-x")
        page.click("#step")
        at_tick(page, 3)
        assert level(page, "alive") == 20
        parted = level(page, "components")
        assert parted > 1
        page.click("#heal")
        page.wait_for_selector("#heal:disabled")
        page.click("#step")
        at_tick(page, 4)
        assert level(page, "components") < parted
        assert page.is_disabled("#jam")
        assert "disk radio" in page.inner_text("#jam-why")


def test_the_run_stops_when_it_is_asked_to_twice_and_the_page_stays(run):
    process, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        page.click("#stop")
        assert ticks(page) == [1] * 5
        page.click("#stop")
        page.wait_for_selector("#state.over")
        assert page.is_disabled("#play")
        assert "the run is over" in page.inner_text("#said")
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 130


def test_the_whole_of_it_listens_on_loopback_and_without_the_token_nothing_is_told(run):
    process, address = run
    sockets = [c for one in family(process.pid) for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
    assert len(sockets) == 3  # the page, rerun's pages and what draws in them
    assert {socket.laddr.ip for socket in sockets} == {"127.0.0.1"}
    origin = "/".join(address.split("/")[:3])
    for path in ("/", "/status", "/news", "/do", f"/x{address.split('/')[3]}/"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(f"{origin}{path}", timeout=20)
    until(lambda: status(address), lambda told: (told["state"], told["tick"]) == ("paused", 1))


def test_nothing_reaches_beyond_a_narrow_window(run):
    _, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        for width in (390, 800, 1400):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("document.documentElement.scrollWidth") <= width
