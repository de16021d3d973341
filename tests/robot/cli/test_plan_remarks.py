"""What was decided while a plan was read is told before the run begins."""

import subprocess
import sys

import numpy as np
import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.runs.metric import run_metric
from lemtomap.robot.runs.simulated import SimOptions, run_sim


class Lines:
    """A bar that keeps what is said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, text: str) -> None:
        self.said.append(text)


@pytest.fixture
def plan(tmp_path):
    grey = np.full((60, 80), 205, dtype=np.uint8)
    grey[10:51, 10:70] = 0
    grey[11:50, 11:69] = 254
    (tmp_path / "m.pgm").write_bytes(b"P5\n80 60\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text(
        "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\nfree_thresh: 0.25\n"
    )
    return tmp_path / "m.yaml"


@pytest.mark.parametrize(("run", "mission"), [(run_sim, "nonsense"), (run_metric, "goto:1:1")])
def test_a_run_in_a_plan_says_first_what_it_takes_for_unknown(plan, tmp_path, run, mission):
    bar = Lines()
    with pytest.raises(BadSetting):  # what is wrong with these runs comes after the plan
        run(SimOptions(str(plan), mission, 1.0, tmp_path / "out"), bar)
    assert len(bar.said) == 1
    assert "m.pgm: grey 205 counts as unknown" in bar.said[0]


def test_the_fake_hardware_says_it_too(plan):
    done = subprocess.run(  # noqa: S603 - our own interpreter and module
        [sys.executable, "-m", "sim.serve", "--world", str(plan), "--duration", "0.05"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "grey 205 counts as unknown" in done.stderr
    assert done.stderr.count("\n") == 1
