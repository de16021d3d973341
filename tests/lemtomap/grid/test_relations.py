import math

import numpy as np
import pytest

from lemtomap import se2
from tools.truth import relations


def written(tmp_path, name, rows):
    path = tmp_path / name
    path.write_text("\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows) + "\n")
    return path


def tum(stamps, poses):
    return [
        (t, x, y, 0, 0, 0, math.sin(a / 2), math.cos(a / 2))
        for t, (x, y, a) in zip(stamps, poses, strict=True)
    ]


PATH = [se2.pose(0.3 * i, 0.01 * i * i, 0.1 * i) for i in range(30)]


def test_a_trajectory_without_error_scores_zero_wherever_its_frame_lies(tmp_path, capsys):
    true = [(i, i + 3, *se2.between(PATH[i], PATH[i + 3])[:2], 0, 0, 0, 0.3) for i in range(20)]
    moved = se2.compose(se2.pose(5.0, -2.0, 2.2), np.array(PATH))
    arguments = [
        str(written(tmp_path, "a.relations", true)),
        str(written(tmp_path, "t.tum", tum(range(30), moved))),
    ]
    assert relations.main(arguments) == 0
    assert "mean 0.0000 +- 0.0000  median 0.0000" in capsys.readouterr().out


def test_an_error_is_counted_where_it_happens_and_only_there(tmp_path):
    stamps, poses = np.arange(30.0), np.array(PATH)
    poses[15:] = se2.compose(se2.pose(0.5, 0.0, 0.1), poses[15:])
    true = np.array([(i, i + 1, *se2.between(PATH[i], PATH[i + 1])) for i in range(29)])
    errors, ways_m, rows = relations.relation_errors(true, stamps, poses)
    wrong = np.hypot(errors[:, 0], errors[:, 1]) > 1e-9
    assert np.flatnonzero(wrong).tolist() == [14]
    assert abs(errors[14, 2]) == pytest.approx(0.1)
    assert len(rows) == 29
    assert ways_m[0] == pytest.approx(math.hypot(0.3, 0.01))


def test_unusable_input_is_one_line_and_code_2(tmp_path, capsys):
    good = written(tmp_path, "t.tum", tum(range(30), PATH))
    other = written(tmp_path, "o.relations", [(900, 901, 0, 0, 0, 0, 0, 0)] * 2)
    assert relations.main([str(tmp_path / "absent"), str(good)]) == 2
    assert relations.main([str(other), str(good)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 2
