"""When a robot counts as stuck, and what it does then."""

import numpy as np
import pytest

from lemtomap.nav.config import RecoveryConfig
from lemtomap.nav.motion.recovery import (
    BreadcrumbTrail,
    ProgressWatch,
    RecoveryBehaviour,
    RecoverySequence,
)
from lemtomap.se2 import IDENTITY, pose

CONFIG = RecoveryConfig()


def stuck_after_s(remaining_m, period_s=0.1):
    """Return when the watch first says stuck, None when it never does."""
    watch = ProgressWatch(CONFIG)
    watch.restart(0.0)
    for k, each_m in enumerate(remaining_m):
        if watch.stuck(float(each_m), k * period_s):
            return k * period_s
    return None


def test_standing_still_is_stuck_after_its_time():
    assert CONFIG.progress_s < stuck_after_s([10.0] * 100) < CONFIG.progress_s + 0.5


def test_a_way_that_proves_longer_is_no_reason_to_recover_while_it_is_driven():
    short, longer = np.arange(12.0, 8.0, -0.04), np.arange(25.0, 0.0, -0.04)
    assert stuck_after_s(np.concatenate([short, longer])) is None


def test_two_targets_by_turns_do_not_pass_for_progress_for_ever():
    there, back = np.arange(10.0, 7.5, -0.04), np.arange(10.5, 8.0, -0.04)
    assert stuck_after_s(np.tile(np.concatenate([there, back]), 20)) < 60.0


def test_rocking_to_and_fro_is_stuck():
    rocking = 10.0 + 0.5 * np.sin(np.arange(0.0, 60.0, 0.1))
    assert stuck_after_s(rocking) < 3.0 * CONFIG.progress_s


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_looking_round_ends_after_one_turn_whichever_way_the_heading_runs(sign):
    ladder, now_s, turned_rad = RecoverySequence(CONFIG), 0.0, 0.0
    while ladder.climb(IDENTITY, now_s) != RecoveryBehaviour.TURN:
        pass
    while (
        ladder.step(pose(0.0, 0.0, sign * turned_rad), BreadcrumbTrail(), now_s, room_behind=True) is not None
    ):
        now_s, turned_rad = now_s + 0.01, turned_rad + 0.1
    assert 2.0 * np.pi <= turned_rad < 2.0 * np.pi + 0.2
    assert not ladder.running


def test_backing_off_ends_where_there_is_no_room_behind_and_after_its_way():
    ladder = RecoverySequence(CONFIG)
    ladder.back_off(IDENTITY, 0.0, 0.2)
    assert ladder.step(pose(-0.1, 0.0, 0.0), BreadcrumbTrail(), 0.1, room_behind=True).v_mps < 0.0
    assert ladder.step(pose(-0.21, 0.0, 0.0), BreadcrumbTrail(), 0.2, room_behind=True) is None
    ladder.back_off(IDENTITY, 1.0, 0.2)
    assert ladder.step(IDENTITY, BreadcrumbTrail(), 1.1, room_behind=False) is None
