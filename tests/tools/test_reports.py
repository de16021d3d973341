"""What the measuring programs conclude from numbers."""

import json

import numpy as np
import pytest

from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Place
from tools.bench import compare as bench_compare
from tools.bench import scale as bench_scale
from tools.bench.soak_parts import judging
from tools.bench.thesis_parts.bare import bare_bytes
from tools.bench.thesis_parts.page import to_html
from tools.bench.thesis_parts.pieces import Piece, Pieces
from tools.bench.thesis_parts.readings import curve_of


def test_paired_ratio_sees_through_a_machine_whose_speed_wanders():
    speed = np.array([1.0, 1.8, 1.1, 2.5, 1.4, 3.0, 1.2])
    old, same, slower = 2.0 * speed, 2.0 * speed * [1.01, 0.99, 1.0, 1.01, 0.99, 1.0, 1.0], 2.2 * speed
    assert not bench_compare.changed(old, same)
    middle, low, high = bench_compare.ratio(old, slower * [1.01, 0.99, 1.0, 1.01, 0.99, 1.0, 1.0])
    assert low < 1.1 < high
    assert low > 1.05
    assert middle == pytest.approx(1.1, abs=0.01)


def test_comparison_names_what_changed_and_nothing_else(tmp_path, capsys):
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    old.write_text(json.dumps({"large": {"cpu_s": [10.0, 12.0, 11.0], "disk_kb": 50.0}}))
    new.write_text(json.dumps({"large": {"cpu_s": [5.0, 6.1, 5.5], "disk_kb": 51.0}}))
    assert bench_compare.main([str(old), str(new)]) == 0
    told = capsys.readouterr().out
    assert "large cpu_s" in told
    assert "x0.50" in told
    assert "disk_kb" not in told


def test_comparison_refuses_a_missing_file(tmp_path, capsys):
    assert bench_compare.main([str(tmp_path / "a.json"), str(tmp_path / "b.json")]) == 2
    assert "a.json: no such file" in capsys.readouterr().err


def test_growth_exponent_is_that_of_the_last_two_decades():
    def size(nodes, ms):
        return bench_scale.Size(nodes / 1000, nodes, ms, 100.0, 400e-6 * nodes, 0.0, 0.0, float("nan"))

    sizes = [size(100, 5.0), size(1_000, 0.5), size(10_000, 0.5), size(100_000, 0.5)]
    assert bench_scale.exponent(sizes, "ms_per_update") == pytest.approx(0.0, abs=1e-9)
    assert bench_scale.exponent(sizes, "file_mb") == pytest.approx(1.0)
    assert np.isnan(bench_scale.exponent(sizes, "open_s"))


def test_load_is_the_slope_of_cpu_time_and_memory_starts_at_nothing():
    rows = [(float(t), 0.02 * t, 180.0 + (5.0 if t > 30 else 0.0)) for t in range(0, 300, 5)]
    curve = curve_of({"rows": rows, "start_mb": 178.0})
    assert curve.load_percent == pytest.approx(2.0)
    assert curve.memory_mb[0] == 2.0
    assert curve.memory_slope_mb_per_h() == pytest.approx(0.0, abs=1e-9)
    assert curve.load_growth() == pytest.approx(1.0)


def test_interrupted_pieces_are_taken_up_where_they_were_left(tmp_path):
    done = []

    def piece(name, *, broken=False):
        def work():
            if broken:
                raise KeyboardInterrupt
            done.append(name)
            return {"told": name}

        return Piece(name, work)

    with pytest.raises(KeyboardInterrupt):
        Pieces(tmp_path).run([piece("a"), piece("b", broken=True), piece("c")], jobs=1)
    pieces = Pieces(tmp_path)
    pieces.run([piece("a"), piece("b")], jobs=1)
    assert done.count("a") == 1
    assert pieces.told("b") == {"told": "b"}


def _soak(tmp_path, *, mb_per_h=0.0, reached=True, off_m=0.05):
    rng = np.random.default_rng(0)
    (tmp_path / "options.json").write_text(json.dumps({"world": "office"}))
    with (tmp_path / "samples.jsonl").open("w") as file:
        for minute in range(1, 181):
            told = {
                "stamp_s": 60.0 * minute,
                "wall_s": 6.0 * minute,
                "nodes": 90,
                "edges": 150,
                "closures": 1,
            }
            told |= {"resident_mb": 300.0 + mb_per_h * minute / 60 + rng.normal(0.0, 0.2), "lost_s": 0.0}
            told |= {f"{part}_cpu_s": 1.0 * minute for part in ("mapping", "navigation", "base")}
            told |= {
                "path_m": 20.0 * minute,
                "contacts": 0,
                "explored": minute > 20,
                "reached": 1,
                "failed": 0,
            }
            file.write(json.dumps(told) + "\n")
    errand = {"node_id": 3, "begun_s": 0.0, "ended_s": 90.0, "reached": reached, "text": "blocked"}
    (tmp_path / "errands.jsonl").write_text(json.dumps(errand) + "\n")
    closure = {"edge_id": 7, "source_id": 1, "target_id": 2, "off_m": off_m, "off_rad": 0.0}
    (tmp_path / "closures.json").write_text(json.dumps([closure]))
    return judging.judge(tmp_path)


@pytest.mark.parametrize(
    ("fault", "broken"),
    [
        ({}, []),
        ({"mb_per_h": 3.0}, ["resident memory"]),
        ({"reached": False}, ["every goal"]),
        ({"off_m": 2.0}, ["no wrong closure"]),
    ],
)
def test_soak_names_the_limit_that_broke(tmp_path, fault, broken):
    verdict = _soak(tmp_path, **fault)
    failed = [asked for asked, _, held in verdict.checks if not held]
    assert [asked for asked in failed if asked.startswith(tuple(broken))] == failed
    assert len(failed) == len(broken)
    assert verdict.passed is not bool(broken)


def test_report_page_keeps_text_from_being_markup():
    page = to_html("a < b\n\n| x | y |\n| --- | --- |\n| <1> | 2 |\n\n- one\n- two & three")
    assert "<p>a &lt; b</p>" in page
    assert "<td>&lt;1&gt;</td>" in page
    assert "<li>two &amp; three</li>" in page


def test_size_without_localisation_data_leaves_the_map_as_it_is(tmp_path):
    path = tmp_path / "map.lemto"
    with TopoStore.create(path, durable=False) as store:
        for _ in range(50):
            node = store.add_node()
            store.put_place(node.node_id, Place(0.0, b"\x02\x32" + bytes(198), bytes(72)))
    whole = path.read_bytes()
    assert bare_bytes(path) < 0.5 * len(whole)
    assert path.read_bytes() == whole
