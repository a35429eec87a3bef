"""An inbox holds so much, and counts what it had no room for."""

import threading

from swarmwire.comms.wire.bounded_inbox import BoundedInbox


def test_what_waits_comes_once_in_order_and_what_has_no_room_is_counted():
    inbox = BoundedInbox[int](3)
    for item in range(5):
        inbox.put(item)
    assert inbox.take() == [0, 1, 2]
    assert inbox.take() == []
    inbox.put(7)
    assert inbox.take() == [7]
    assert inbox.dropped == 2


def test_nothing_is_lost_uncounted_when_several_threads_put():
    inbox, taken = BoundedInbox[int](50), list[int]()
    threads = [threading.Thread(target=lambda: [inbox.put(item) for item in range(2000)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        taken += inbox.take()
    taken += inbox.take()
    assert len(taken) + inbox.dropped == 8000
