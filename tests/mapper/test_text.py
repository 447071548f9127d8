"""Numbers as people read them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thingmap.mapper.map.text import probability_text


@pytest.mark.parametrize(
    ("p", "text"),
    [
        (0.384, "0.38"),
        (0.99, "0.99"),
        (0.9951, ">0.99"),
        (1.0, "1.00"),
        (0.01, "0.01"),
        (0.004, "<0.01"),
        (0.0, "0.00"),
    ],
)
def test_a_probability_has_two_digits(p: float, text: str) -> None:
    assert probability_text(p) == text


@given(st.floats(0.0, 1.0, exclude_min=True, exclude_max=True))
def test_no_probability_is_rounded_to_certainty(p: float) -> None:
    text = probability_text(p)
    assert text not in ("0.00", "1.00")
    assert abs(float(text.lstrip("<>")) - p) <= 0.01
