"""Handing over between threads."""

import threading

from lemtomap.robot.mailbox import BoundedQueue, Latest


def test_latest_gives_the_newest_and_wakes_a_waiting_reader():
    box = Latest()
    assert box.get() is None
    box.put(1)
    box.put(2)
    assert box.wait(1, 0.0) == (2, 2)
    thread = threading.Timer(0.02, box.put, [3])
    thread.start()
    assert box.wait(2, 5.0) == (3, 3)
    thread.join()


def test_waiting_for_nothing_ends_with_the_old_value():
    box = Latest()
    box.put("old")
    assert box.wait(1, 0.01) == ("old", 1)


def test_a_full_queue_drops_the_oldest_and_counts_it():
    queue = BoundedQueue("scans", 2)
    for value in range(5):
        queue.put(value)
    assert (len(queue), queue.dropped) == (2, 3)
    assert (queue.get(), queue.get(), queue.get()) == (3, 4, None)


def test_a_reader_waits_for_the_first_value_and_drains_the_rest_in_order():
    queue = BoundedQueue("events", 10)
    thread = threading.Timer(0.02, queue.put, ["a"])
    thread.start()
    assert queue.get(5.0) == "a"
    thread.join()
    for value in "bcd":
        queue.put(value)
    assert queue.drain() == ["b", "c", "d"]
    assert queue.get(0.001) is None
