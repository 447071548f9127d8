"""The whole picture: boxes in their colours over the cloud, and what is doubtful is faint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from drawing.picture import draw
from drawing.scene import PALETTE, Scene, choose_view

from thingmap.mapper.map.thing import Thing


def test_corners_of_the_boxes_have_their_label_s_colour(scene: Scene, pixels: Callable[..., np.ndarray]) -> None:
    view = choose_view(scene, 800)
    image, _ = draw(scene, view)
    assert image.shape == (400, 800, 3) and image.dtype == np.uint8
    for thing in scene.things:
        color = np.array(scene.palette[thing.label])
        for u, v in np.round(pixels(view, thing.corners(scene.R_world_upright))).astype(int):
            around = image[v - 2 : v + 3, u - 2 : u + 3].reshape(-1, 3).astype(int)
            assert np.abs(around - color).sum(axis=1).min() < 90, (thing.label, u, v)


def test_a_doubtful_thing_is_fainter(scene: Scene, pixels: Callable[..., np.ndarray]) -> None:
    cup = scene.things[0]
    doubtful = replace(cup, probability=0.4, class_posterior={"cup": 0.4})
    view = choose_view(scene, 800)
    sure, unsure = (draw(replace(scene, things=(t,)), view)[0].astype(int) for t in (cup, doubtful))
    color = np.array(PALETTE[0])
    u, v = np.round(pixels(view, cup.corners(scene.R_world_upright)[4:6]).mean(axis=0)).astype(int)
    near = np.s_[v - 2 : v + 3, u - 2 : u + 3]
    distance = [np.abs(image[near] - color).sum(axis=-1).min() for image in (sure, unsure)]
    assert distance[0] < 60 and distance[1] > 2 * distance[0]


def test_tags_without_room_are_counted(scene: Scene, make_thing: Callable[..., Thing]) -> None:
    endless = (*scene.things, make_thing(3, "cup " * 100))
    _, missing = draw(replace(scene, things=endless), choose_view(scene, 320))
    assert missing == 1
