"""A run as it goes on, for a viewer of rerun's that listens: drawn as in a recording, as far as the viewer gets it."""

from typing import Any

from swarmwire.comms.clock import Clock
from swarmwire.comms.truth import Static
from swarmwire.metrics.viewer.layout import layout, page_layout
from swarmwire.metrics.viewer.plotted import Measured
from swarmwire.metrics.viewer.recording import RerunRecording


class RerunLive(RerunRecording):
    """Observer that draws one arena of a run in the viewer at a URL, which shows the newest tick.

    For a process of its own: a call waits for a viewer that does not take what it is sent.
    """

    _send_bytes = 0  # people wait for it

    def __init__(
        self,
        url: str,
        metrics: Measured,
        clock: Clock,
        arena: int = 0,
        selected: str | None = None,
        *,
        page: bool = False,
    ) -> None:
        """Draw in the viewer at "rerun+http://…/proxy", laid out for the `page` if that is it.

        BadInput without the extra [view].
        """
        super().__init__(None, metrics, clock, arena, selected)
        self._url, self._page = url, page

    def _layout(self, static: Static, selected: str) -> Any:
        return page_layout(static, selected) if self._page else layout(static, selected, "following")

    def _connect(self, layout: Any) -> None:
        self._arena_view.links_every_ticks = 1  # whoever publishes the ticks has thinned the links already
        self._rec.connect_grpc(self._url, default_blueprint=layout)
