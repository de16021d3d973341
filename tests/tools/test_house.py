"""What the house keeps to beyond what the import contracts say."""

import networkx as nx

from tools.checks import house


def test_no_two_files_import_one_another_in_a_circle():
    assert house.circles(house.import_graph()) == []


def test_a_circle_would_be_found():
    assert house.circles(nx.DiGraph([("a", "b"), ("b", "c"), ("c", "a"), ("a", "d")])) == [["a", "b", "c"]]


def test_no_class_name_means_two_things():
    assert house.class_names_twice() == {}


def test_a_file_stands_in_a_room():
    assert house.room("lemtomap.robot.motion.safety") == "robot.motion"
    assert house.room("lemtomap.robot.core") == "robot"
    assert house.room("lemtomap.topo.loops.closer") == "topo.loops"
