"""What mapping and navigation owe, and since when."""

import math

from lemtomap.robot.exchange import Exchange
from lemtomap.robot.motion.watchdog import OWED_KEPT, Watchdog


def test_nothing_is_owed_before_the_first_scan_and_after_the_last_was_mapped():
    exchange = Exchange()
    dog = Watchdog(exchange)
    assert dog.map_stamp_s(5.0) == 5.0
    dog.saw(5.0, 5.1)
    exchange.mapped.put(5.0)
    assert dog.map_stamp_s(5.4) == 5.4


def test_the_oldest_scan_that_is_not_in_the_map_counts():
    exchange = Exchange()
    dog = Watchdog(exchange)
    for stamp_s in (1.0, 1.1, 1.2):
        dog.saw(stamp_s, stamp_s + 0.08)
    assert dog.map_stamp_s(1.3) == 1.08
    exchange.mapped.put(1.0)
    assert dog.map_stamp_s(1.3) == 1.1 + 0.08


def test_a_later_scan_in_the_map_makes_up_for_those_that_were_dropped():
    exchange = Exchange()
    dog = Watchdog(exchange)
    for stamp_s in (1.0, 1.1, 1.2):
        dog.saw(stamp_s, stamp_s + 0.08)
    exchange.mapped.put(1.2)
    assert dog.map_stamp_s(1.3) == 1.3


def test_however_long_mapping_hangs_the_first_scan_is_remembered_and_no_more_kept():
    dog = Watchdog(Exchange())
    for index in range(5 * OWED_KEPT):
        dog.saw(0.1 * index, 0.1 * index + 0.08)
    assert dog.map_stamp_s(math.inf) == 0.08
    assert len(dog._owed) == OWED_KEPT


def test_navigation_is_counted_from_its_latest_cycle_and_until_the_first_from_when_it_was_asked_for():
    exchange = Exchange()
    dog = Watchdog(exchange)
    assert [dog.cycle_stamp_s(now_s) for now_s in (2.0, 2.1, 9.0)] == [2.0, 2.0, 2.0]
    exchange.cycle.put(9.5)
    assert dog.cycle_stamp_s(9.6) == 9.5
