"""What a process spends is told thread by thread, and the parts add up to it."""

import threading
import time

import pytest

from lemtomap.robot.thread_times import ThreadTimes


def work(cpu_s):
    end_s = time.thread_time() + cpu_s
    while time.thread_time() < end_s:
        pass


def test_the_parts_add_up_to_the_process_and_each_thread_has_its_own():
    times = ThreadTimes()

    def booked():
        with times.thread("mapping"):
            work(0.06)

    with times.running():
        threads = [threading.Thread(target=booked), threading.Thread(target=work, args=(0.03,))]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
    work(0.02)
    before_s = time.process_time()
    spent_s = times.spent_s()
    assert before_s <= sum(spent_s.values()) <= time.process_time()
    assert spent_s["mapping"] == pytest.approx(0.06, abs=0.02)
    assert spent_s["libraries"] >= 0.03
    assert spent_s["results"] >= 0.02


def test_what_was_spent_before_the_run_is_its_start():
    times = ThreadTimes()
    begun_s = time.process_time()
    with times.running():
        pass
    assert begun_s <= times.spent_s()["start"] <= time.process_time()
