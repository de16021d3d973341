"""What may be the name of a place, and how any other text is shown."""

import pytest

from lemtomap.topo import naming


@pytest.mark.parametrize(
    "name",
    [
        "",
        "12",
        "-3",
        "+7",
        "\u0661\u0662",  # digits of another script
        "a,b",
        " lab",
        "lab ",
        "a\tb",
        "a\nb",
        "\x1b[31mred",
        "a\x00b",
        "nul\u200b",
        "\ud800",
        "far",
        "Start",
        "here",
        "level",
        "area",
        "node",
        "any",
        "dock",
        "explore",
        "tour",
        "goto",
        "level:2",
        "area:4",
        "any kitchen",
        "Node7",
        "node 7",
        "x" * 81,
        "x" * 5000,
    ],
)
def test_what_a_mission_a_number_or_a_terminal_would_misread_is_no_name(name):
    assert naming.fault(name)


@pytest.mark.parametrize(
    "name",
    [
        r"lab $\foo$",
        "K\u00fcche",
        "\u53a8\u623f",
        "\u043a\u0443\u0445\u043d\u044f",
        "\U0001f373",
        "room 2.17",
        "4.12",
        "start room",
        "farmers",
        "dock 2",
        "anyone",
        "it's",
        "<b>&amp;",
        "a_b",
        "wing: east",
        "x" * 80,
    ],
)
def test_whatever_else_prints_is_a_name(name):
    assert naming.fault(name) is None
    assert naming.shown(name) == naming.listed(name) == name


def test_what_does_not_print_is_shown_escaped_and_what_is_long_cut():
    assert naming.shown("a\x1b[2Jb\n") == r"a\x1b[2Jb\n"
    assert naming.shown("\udcff") == r"\udcff"
    assert naming.listed("a, b") == "'a, b'"
    assert len(naming.shown("x" * 5000)) == naming.LONGEST_NAME


def test_a_node_is_meant_by_number_first_then_by_name_then_by_what_is_shown_of_it():
    names = {"kitchen": 4, "7": 1, "a\x1bb": 2}

    def meant(text):
        return naming.node_meant(text, names, lambda number: number in (4, 5))

    assert [meant(text) for text in ("5", "kitchen", "7", r"a\x1bb", "6", "lab")] == [5, 4, 1, 2, None, None]
    assert meant("9" * 5000) is None


def test_who_asks_for_a_name_that_is_not_there_hears_the_nearest_one_or_all():
    names = {"Kitchen": 4, "lab": 5}
    assert naming.told_instead("kichen", names) == "did you mean 'Kitchen'?"
    assert naming.told_instead("zzz", names) == "names: Kitchen, lab"
    assert naming.told_instead("zzz", {}) == "names: none"
    assert naming.told_instead("zzz", {f"p{k:02d}": k for k in range(11)}).endswith("p09, ...")
