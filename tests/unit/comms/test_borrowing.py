"""Kernels that only other kernels call."""

import pytest

from swarmwire.comms.air.signal.event_queue import SEND, event_queue, schedule


@pytest.mark.skipif(not hasattr(schedule, "overloads"), reason="kernels are plain Python: anybody can call them")
def test_a_kernel_for_kernels_refuses_to_be_called_by_python() -> None:
    queue = event_queue(1)
    with pytest.raises(TypeError, match="schedule: expected a call by another kernel"):
        schedule(queue, SEND, 0, 5)
    assert queue.size[0] == 0
