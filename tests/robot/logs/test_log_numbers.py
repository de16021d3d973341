"""The fields of a line: the same numbers that Python reads, whoever wrote them."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lemtomap.robot.logs.kernels.decimals import decimals
from lemtomap.robot.logs.numbers import BrokenLine, Fields

BLANKS = st.sampled_from([" ", "\t", "  ", "\r", "\x0b", "\x1c", "\x1f"])
WRITTEN = st.one_of(
    st.floats(-1e4, 1e4).map(lambda value: f"{value:.2f}"),
    st.floats().map(repr),
    st.integers().map(str),
    st.from_regex(r"[+-]?[0-9]{0,25}\.?[0-9]{0,25}", fullmatch=True).filter(lambda text: text != ""),
    st.sampled_from([".5", "5.", "-0", "+.0", ".", "-", "1_0", "0x1", "1e3", "nan", "-inf", "1.2.3", "--1"]),
)


def python_reads(text):
    try:
        return float(text)
    except ValueError:
        return None


@settings(deadline=None)  # the first line may have to wait for a compiler
@example([f"{value:.17f}" for value in np.random.default_rng(0).random(200)], " ")
@given(st.lists(WRITTEN, max_size=8), BLANKS)
def test_every_field_is_the_number_that_python_reads_to_the_last_bit(texts, blank):
    fields = Fields(blank.join(texts) + blank)
    assert len(fields) == len(texts)
    for at, text in enumerate(texts):
        expected = python_reads(text)
        if expected is None or not math.isfinite(expected) or abs(expected) > 1e300:
            with pytest.raises(BrokenLine):
                fields.number(at, 1e300)
        else:
            read = fields.number(at, 1e300)
            assert read == expected
            assert math.copysign(1.0, read) == math.copysign(1.0, expected)


@settings(deadline=None)
@given(st.text(max_size=30))
def test_a_line_has_the_fields_that_python_parts_it_into(line):
    assert len(Fields(line)) == len(line.split())


def test_plain_decimals_are_read_without_a_look_at_the_text():
    values = decimals(np.frombuffer(b"FLASER 3 1.25 -0.5 81.91 7", np.uint8))
    assert values[1:].tolist() == [3.0, 1.25, -0.5, 81.91, 7.0]
    assert math.isnan(values[0])


def test_one_odd_reading_does_no_harm_to_its_neighbours():
    readings = Fields("1.5 nan 2e0 9999 3").readings(0, 5)
    np.testing.assert_array_equal(readings, [1.5, np.nan, 2.0, np.nan, 3.0])


def test_a_word_among_the_readings_is_named():
    with pytest.raises(BrokenLine, match="'host' stands where a number belongs"):
        Fields("1.5 host 2").readings(0, 3)
