"""A run on the page: rerun's viewer, with controls and fault injection beside it."""

import webbrowser
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from typing import Any

from swarmwire.comms.run_views import ObservedRun
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.live.following import Live, following
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.live.viewer import Drawer, ViewOptions, has_screen
from swarmwire.deploy.page.news import NewsThread, Seen
from swarmwire.deploy.page.server import Shown, page_app, serving


def show_page(live: Live, options: ViewOptions, network: Network | None = None, *, begin: bool = False) -> None:
    """Show the run until `options.stopped()` or its viewer is gone; RunGone if the run does not answer.

    `network` brings the certificates that a run on another machine asks for. With `begin` the first tick of a run that
    waits for the page is asked for: without it there would be nothing to see.
    """
    clock = options.clock
    viewing = replace(options, web=True, port=None).viewer(None)
    with following(live, network) as run, viewing as shown, controlling(live.endpoint, live.run, network) as control:
        assert shown.web is not None, "a viewer with pages was asked for"
        seen = Seen(run.scene.static)
        drawer = Drawer(run, shown.url, options, seen.see)
        drawer.start()
        told = Shown(shown.web, shown.url, facts(run.scene))
        news = NewsThread(control, lambda: seen.numbers, clock, lambda: run.over)
        with (
            serving(lambda token, port: page_app(control, news, told, token, port), clock, options.port) as address,
            closing(news),  # first, so that no page waits for more
        ):
            news.start()
            options.say(f"open {address} in a browser{'' if begin else '; Ctrl-C ends the page'}")
            if has_screen():
                webbrowser.open(address)
            if begin:
                _first_tick(control)
            while shown.alive and not options.stopped() and drawer.fault is None:
                options.pause()
    if drawer.fault is not None:
        raise drawer.fault


def _first_tick(control: RemoteControl) -> None:
    status = control.status()
    if status["state"] == "paused" and status["tick"] == 0:
        control.step()


def facts(scene: ObservedRun) -> Mapping[str, Any]:
    """The constants of a run, as sent to the page."""
    static = scene.static
    return {
        "name": static.name,
        "seed": static.seeds[0],
        "rate_hz": static.rate_hz,
        "arena_m": list(static.arena_size_m),
        "robots": list(static.robot_names),
        "groups": [group.name for group in static.groups],
        "series": [
            {"name": series.name, "unit": series.unit, "bounds": list(series.bounds)} for series in scene.series
        ],
        "obstacles": [
            {"x": one.x_m, "y": one.y_m, "radius": one.radius_m, "corners": one.corners_m.tolist()}
            for one in static.fixed(0)
        ],
    }
