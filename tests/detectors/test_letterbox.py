"""Fitting an image into a network's input and boxes back."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from thingmap.detectors.letterbox import GREY, Letterbox


def test_wide_image_in_the_corner():
    box = Letterbox.fit((640, 480), (416, 416), centred=False)
    assert box.scaled == (416, 312) and box.offset == (0, 0)
    image = box.image(np.full((480, 640, 3), 7, dtype=np.uint8))
    assert image.shape == (416, 416, 3) and (image[:312] == 7).all() and (image[312:] == GREY).all()
    # 0.65 pixels of the input for one of the image.
    np.testing.assert_allclose(box.to_source(np.array([[65.0, 130.0, 416.0, 312.0]])), [[100, 200, 640, 480]])


def test_tall_image_in_the_middle():
    box = Letterbox.fit((20, 40), (64, 64), centred=True)
    assert box.scaled == (32, 64) and box.offset == (16, 0)
    image = box.image(np.full((40, 20, 3), 7, dtype=np.uint8))
    assert (image[:, 16:48] == 7).all() and (image[:, :16] == GREY).all() and (image[:, 48:] == GREY).all()
    np.testing.assert_allclose(box.to_source(np.array([[16.0, 0.0, 32.0, 64.0]])), [[0, 0, 10, 40]])


sides = st.integers(1, 3000)


@given(sides, sides, st.sampled_from([32, 416, 640]), st.sampled_from([64, 416, 640]), st.booleans())
def test_the_image_lies_inside_and_comes_back_whole(width: int, height: int, w: int, h: int, centred: bool):
    box = Letterbox.fit((width, height), (w, h), centred=centred)
    (x, y), (sw, sh) = box.offset, box.scaled
    assert x >= 0 and x + sw <= w and y >= 0 and y + sh <= h
    assert sw == w or sh == h
    inside = np.array([[x, y, x + sw, y + sh]], dtype=float)
    np.testing.assert_allclose(box.to_source(inside), [[0, 0, width, height]], atol=1e-9)
