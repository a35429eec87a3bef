"""The page."""

import io
import json
import sys
import urllib.error
import urllib.request

import psutil
import pytest
from rich.console import Console

from swarmwire.deploy.live.live_view import PageBeside
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from tests.support.clocks import until
from tests.support.deploy.page import PATIENCE_MS, chromium, family, launched, paged, requested_hosts
from tests.support.deploy.runs import LOSSY, refused_command

TICKS = """(count) => new Promise((done) => {
  const news = new EventSource("news"), ticks = [];
  news.addEventListener("status", (event) => {
    ticks.push(JSON.parse(event.data).tick);
    if (ticks.length === count) { news.close(); done(ticks); }
  });
})"""


@pytest.mark.parametrize("command", [["/none/such"], [sys.executable, "-c", "import sys; sys.exit('no page today')"]])
def test_run_whose_page_cannot_be_opened_goes_on_by_itself(tmp_path, command, monkeypatch, capsys):
    out = io.StringIO()
    simulation = Simulation(LOSSY, overrides=["duration_s=0.5"], out=tmp_path / "run")
    with PageBeside(simulation, tmp_path / "run", Console(file=out, width=40)) as page:
        monkeypatch.setattr(page, "_command", command)
        simulation.watch(page)
        result = run_to_end(simulation)
    assert (result.ended, result.ticks) == ("duration", 5)
    assert "no live view" in capsys.readouterr().err or out.getvalue() == "no page today\n"


@pytest.mark.parametrize(("paused", "held"), [(True, "paused: swarmwire ctl resume"), (False, "running")])
def test_page_begins_a_run_paused_and_if_killed_ends_none_and_prints_what_can_be_done(
    tmp_path, monkeypatch, paused, held
):
    out = io.StringIO()
    simulation = Simulation(LOSSY, overrides=["duration_s=1"], out=tmp_path / "run")
    page = PageBeside(simulation, tmp_path / "run", Console(file=out))
    monkeypatch.setattr(page, "_command", [sys.executable, "-c", "import sys; sys.stdin.read()"])
    simulation.watch(page)
    with page, simulation:
        assert (simulation.controls.paused, simulation.controls.speed) == (True, 1.0)
        simulation.step()
        simulation.step()
        if not paused:
            simulation.controls.resume()
        assert page.pid is not None
        psutil.Process(page.pid).kill()
        until(lambda: out.getvalue().endswith("\n"))
        assert f"the run is {held}" in out.getvalue()
        assert "swarmwire ui" in out.getvalue()
        simulation.controls.set_speed(None)
        simulation.controls.resume()
        simulation.run()
    assert simulation.result.ended == "duration"


def test_without_the_extra_it_is_named_and_no_folder_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    command = ("run", LOSSY, "--ui", "--out", tmp_path / "run")
    refused_command(monkeypatch, capsys, *command, match=r"--ui: .*swarmwire\[ui\]")
    assert not (tmp_path / "run").exists()


def test_page_without_a_run_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("RUST_LOG", "off")
    for arguments in ([], ["3f2a"], [str(tmp_path)]):
        refused_command(monkeypatch, capsys, "ui", *arguments, match=".*live run")


pytest.importorskip("fastapi", reason="needs the extra [ui]")
pytest.importorskip("rerun", reason="needs the extra [view]")


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
        until(lambda: page.inner_text("#speed-now"), lambda text: text == "× 2")
        page.keyboard.press(" ")
        page.wait_for_selector("#state.running")
        until(lambda: int(page.get_attribute("#ticks", "data-tick")), lambda tick: tick > 25)
        page.keyboard.press(" ")
        page.wait_for_selector("#state.paused")
        paused_at = ticks(page)
        assert len(set(paused_at)) == 1
        assert paused_at[0] > 25


def test_page_disturbs_the_run_and_undoes_it_in_windows_of_any_width(run):
    _, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        level_before = level(page, "components")
        slider = page.locator("#radio-loss")
        slider.focus()
        slider.press("End")
        page.click("#step10")
        at_tick(page, 11)
        assert level(page, "components") == 20 > level_before
        assert page.inner_text("#events li >> nth=0").split("\n")[:2] == ["tick 1", "radio.loss = 1.0 by hand"]
        slider.focus()
        slider.press("Home")
        page.click("#step")
        at_tick(page, 12)
        assert level(page, "components") == level_before
        page.select_option("#robot", "flock-3")
        page.click("#kill")
        page.wait_for_selector("text=next tick")
        page.click("#step")
        at_tick(page, 13)
        assert level(page, "alive") == 19
        page.wait_for_selector("#events li:has-text('kill: flock-3')")
        page.click("#revive-all")
        page.click("#halve-x")
        page.click("#step")
        at_tick(page, 14)
        assert level(page, "alive") == 20
        parted = level(page, "components")
        assert parted > 1
        page.click("#heal")
        page.wait_for_selector("#heal:disabled")
        page.click("#step")
        at_tick(page, 15)
        assert level(page, "components") < parted
        assert page.is_disabled("#jam")
        assert "disk radio" in page.inner_text("#jam-why")
        for width in (390, 800, 1400):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_page_stops_the_run_at_the_second_click_and_stays_until_closed(run):
    process, address = run
    with chromium(address) as page:
        at_tick(page, 1)
        page.click("#stop")
        assert ticks(page) == [1] * 5
        page.click("#stop")
        page.wait_for_selector("#state.over")
        assert page.is_disabled("#play")
        assert page.inner_text("#play").strip() == "Ended"
        assert not page.query_selector_all("#transport button:enabled, .acts button:enabled")
        assert "the run is over" in page.inner_text("#notice")
        page.reload()
        page.wait_for_selector("#state.over")
    assert process.wait(60) == 130  # as the run was interrupted


def test_run_returns_once_it_is_over_and_its_page_was_closed_before(tmp_path):
    with paged(LOSSY, tmp_path / "run", "--no-rrd", "--set", "duration_s=1") as (process, address):
        with chromium(address) as page:
            at_tick(page, 1)
            page.evaluate("() => fetch('do', {method: 'POST', headers: {'Content-Type': 'application/json'}, "
                          "body: JSON.stringify({do: 'resume'})})")  # fmt: skip
        assert process.wait(60) == 0


GREEDY = """let wasm_bindgen = async () => {};
wasm_bindgen.WebHandle = class {
  async start(canvas) {
    canvas.tabIndex = 0;
    canvas.addEventListener("keydown", (event) => event.preventDefault());
    const field = document.body.appendChild(document.createElement("input"));
    field.addEventListener("focus", () => canvas.focus());
  }
};"""  # a viewer that takes every key for itself, and has a hidden text field, as rerun's does


def test_tab_key_leads_into_the_viewer_and_out_of_it_both_ways(run):
    _, address = run
    with launched() as browser:
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.set_default_timeout(PATIENCE_MS)
        page.route("**/re_viewer.js", lambda route: route.fulfill(body=GREEDY, content_type="text/javascript"))
        page.goto(address)
        page.frame_locator("#viewer").locator("#state").wait_for(state="detached")
        at_tick(page, 1)

        for key, focus in (("Tab", "viewer"), ("Tab", "play"), ("Shift+Tab", "viewer")):
            page.keyboard.press(key)
            page.wait_for_function("id => document.activeElement.id === id", arg=focus)
        page.keyboard.press("Shift+Tab")
        page.wait_for_function("() => document.activeElement.id !== 'viewer'")


def test_page_listens_on_loopback_and_answers_only_with_the_token(run):
    process, address = run
    sockets = [c for one in family(process.pid) for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
    assert len(sockets) == 2  # the page and its viewer
    assert {socket.laddr.ip for socket in sockets} == {"127.0.0.1"}
    origin = "/".join(address.split("/")[:3])
    for path in ("/", "/status", "/news", "/do", f"/x{address.split('/')[3]}/"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(f"{origin}{path}", timeout=20)
    until(lambda: status(address), lambda answer: (answer["state"], answer["tick"]) == ("paused", 1))


def test_browser_requests_of_the_page_and_its_viewer_stay_on_this_machine(run):
    """Rerun's own page asks fonts.googleapis.com, api.github.com, app.rerun.io and tel.rerun.io."""
    _, address = run
    assert requested_hosts(address) == {"127.0.0.1"}
