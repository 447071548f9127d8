"""The PNG decodes, by OpenCV, to nearly the picture it was made of."""

from __future__ import annotations

import cv2
import numpy as np
from drawing.png import encode_png


def _decoded(data: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert image is not None
    return image


def test_the_png_is_the_picture_in_256_colours() -> None:
    image = np.zeros((60, 90, 3), dtype=np.uint8)
    image[..., 0], image[..., 1] = np.linspace(0, 255, 90), np.linspace(0, 255, 60)[:, None]
    image[20, 30] = (1, 2, 253)
    data = encode_png(image, [(1, 2, 253)])
    decoded = _decoded(data)
    assert decoded.shape == image.shape and tuple(decoded[20, 30]) == (1, 2, 253)
    assert np.abs(decoded.astype(int) - image).max() <= 24
    assert len(np.unique(decoded.reshape(-1, 3), axis=0)) <= 256
    assert data == encode_png(image, [(1, 2, 253)])


def test_an_image_of_few_colours_keeps_them_all() -> None:
    image = np.array([(0, 0, 0), (255, 0, 0), (0, 255, 0), (9, 9, 255)], dtype=np.uint8)[
        np.arange(48).reshape(6, 8) % 4
    ]
    assert np.array_equal(_decoded(encode_png(image)), image)
