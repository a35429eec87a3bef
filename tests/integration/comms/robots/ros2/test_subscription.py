"""What arrives on a topic is handed on; of rmw_zenoh's frames only those with their attachment."""

# zenoh's stubs leave out return types.
# pyright: reportUnknownMemberType=false

import queue

from swarmwire.comms.robots.ros2 import links
from swarmwire.comms.robots.ros2.keys import attachment
from swarmwire.comms.robots.ros2.links import Subscription

WAIT_S = 10.0


def test_frames_without_their_attachment_are_refused_by_name():
    router, endpoint = links.open_router("tcp/127.0.0.1:0")
    client = links.open_client(endpoint, 5.0)
    taken: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    refused: queue.SimpleQueue[str] = queue.SimpleQueue()
    subscription = Subscription(router, "0/scan", attached=True, take=taken.put, refuse=refused.put)
    try:
        client.put("0/scan", b"bare")
        assert refused.get(timeout=WAIT_S) == "no_attachment"
        client.put("0/scan", b"whole", attachment=attachment(0, 1, bytes(16)))
        assert taken.get(timeout=WAIT_S) == b"whole"
        assert taken.empty()
        subscription.close()
    finally:
        links.close(client)
        links.close(router)
