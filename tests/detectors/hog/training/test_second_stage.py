"""Which windows show what, and a second stage learned from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from thingmap.datasets.errors import UserError
from thingmap.datasets.object_views.backgrounds import Background, Backgrounds
from thingmap.detectors.detections import Part
from thingmap.detectors.hog.channels import Channels
from thingmap.detectors.hog.config import PyramidConfig
from thingmap.detectors.hog.model import HogModel, HogTemplate, load_model
from thingmap.detectors.hog.pyramid import window_features
from thingmap.detectors.hog.second_stage.network import moved_boxes
from thingmap.detectors.hog.training.network_fit import UNKNOWN, FitConfig
from thingmap.detectors.hog.training.second_stage import (
    SecondStageConfig,
    train_second_stage,
    what_they_show,
    window_samples,
)

CONFIG = SecondStageConfig(fit=FitConfig(hidden=(24,), dropout=(0.0, 0.0), epochs=30, batch=64))
MARGIN = 3  # pixels about a card in its window


@pytest.fixture(scope="module")
def model(make_frame_with) -> HogModel:
    """Templates of whole cards, each made from one window: its features less their mean."""
    templates = []
    for class_id, label in enumerate(("cross", "disc")):
        seen = make_frame_with(1, label)
        window = seen.xyxy[0] + np.array([-MARGIN, -MARGIN, MARGIN, MARGIN])
        features, _ = window_features(seen.color, seen.depth, seen.focal, window, (4, 4), Channels.RGBD)
        weights = features - features.mean(axis=(0, 1))
        weights /= (weights**2).sum()
        bias = -float((weights * features).sum())
        share = MARGIN / (window[2] - window[0])
        box = share, share, 1.0 - share, 1.0 - share
        templates.append(HogTemplate(class_id, Part.WHOLE, weights, 0.0, bias, (-8.0, -4.0), box))
    return HogModel(("cross", "disc"), Channels.RGBD, tuple(templates), PyramidConfig(max_scale=2.0), {})


def frame_of(*things: tuple[str, tuple, tuple, float]) -> Background:
    """Of labels, whole boxes, visible boxes and visibilities."""
    labels, whole, visible, visibility = zip(*things, strict=True)
    boxes = np.array(whole, dtype=np.float64), np.array(visible, dtype=np.float64)
    image = np.zeros((90, 120, 3), np.uint8)
    return Background("x", image, None, 300.0, labels, boxes[0], np.array(visibility), boxes[1])


def test_a_window_shows_what_it_has_most_in_common_with():
    disc = ("disc", (10.0, 10.0, 50.0, 50.0), (10.0, 10.0, 30.0, 50.0), 0.5)
    cross = ("cross", (60.0, 10.0, 100.0, 50.0), (60.0, 10.0, 100.0, 50.0), 1.0)
    windows = np.array(
        [
            [10.0, 12.0, 50.0, 52.0],  # the whole disc
            [10.0, 10.0, 32.0, 50.0],  # what is seen of it
            [61.0, 10.0, 101.0, 50.0],  # the cross
            [60.0, 10.0, 80.0, 38.0],  # a part of it: 0.35
            [60.0, 10.0, 70.0, 50.0],  # less: 0.25
            [0.0, 60.0, 40.0, 90.0],  # nothing
        ]
    )
    label, offsets = what_they_show(windows, frame_of(disc, cross), ("cross", "disc"), SecondStageConfig())
    assert label.tolist() == [1, 1, 0, UNKNOWN, 2, 2]
    expected = np.array([disc[1], disc[2], cross[1]])
    np.testing.assert_allclose(moved_boxes(windows[:3], offsets[:3]), expected, atol=1e-4)


def test_what_is_hardly_seen_and_other_things():
    hidden = ("disc", (10.0, 10.0, 50.0, 50.0), (np.nan,) * 4, 0.0)
    book = ("book", (60.0, 10.0, 100.0, 50.0), (60.0, 10.0, 100.0, 50.0), 1.0)
    windows = np.array([hidden[1], book[1]])
    label, _ = what_they_show(windows, frame_of(hidden, book), ("cross", "disc"), SecondStageConfig())
    assert label.tolist() == [UNKNOWN, 2]
    label, _ = what_they_show(windows, frame_of(book), ("cross", "disc"), SecondStageConfig())
    assert label.tolist() == [2, 2]
    assert what_they_show(windows[:0], frame_of(book), ("book",), SecondStageConfig())[0].shape == (0,)


def test_on_frames_it_has_not_seen_it_tells_what_windows_show_and_corrects_their_boxes(
    model, make_frame_with, tmp_path
):
    frames = [make_frame_with(seed, *2 * ("disc", "cross")) for seed in range(60)]
    better = train_second_stage(model, backgrounds_of(*frames), CONFIG, sources=("walls",))
    assert better.about["second_stage"]["settings"]["sources"] == ["walls"]
    assert better.about["second_stage"]["frames"] == 60 and model.second_stage is None
    better.save(tmp_path / "m.npz")
    network = load_model(tmp_path / "m.npz").second_stage
    assert network is not None
    right, before, after = [], [], []
    for seed in range(500, 510):
        samples = window_samples(better, make_frame_with(seed, "disc", "cross"), CONFIG)
        z = network.outputs(samples.views.astype(np.float32))
        known, shown = samples.label != UNKNOWN, (samples.label != UNKNOWN) & (samples.label < 2)
        right += (z[known, :3].argmax(axis=1) == samples.label[known]).tolist()
        before.append(np.abs(samples.offsets[shown]).mean())
        after.append(np.abs(z[shown, -4:] - samples.offsets[shown]).mean())
    assert np.mean(right) > 0.9
    assert np.mean(after) < 0.7 * np.mean(before)


def test_what_cannot_be_learned_from(model, make_frame_with, make_backgrounds):
    with pytest.raises(UserError, match="shows cross; add frames"):
        train_second_stage(model, backgrounds_of(make_frame_with(1, "disc")), CONFIG)
    with pytest.raises(UserError, match="no depth"):
        train_second_stage(model, make_backgrounds(2, depth=False), CONFIG)
    colour = replace(
        model, channels=Channels.RGB, templates=tuple(replace(t, weights=t.weights[..., :31]) for t in model.templates)
    )
    with pytest.raises(UserError, match="looks at depth"):
        train_second_stage(colour, make_backgrounds(2), CONFIG)


def backgrounds_of(*frames: Background) -> Backgrounds:
    made = Backgrounds()
    made._entries = [(frame.name, lambda frame=frame: frame) for frame in frames]
    return made
