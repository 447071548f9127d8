import numpy as np
import pytest

from thingmap.detectors.detections import Detections
from thingmap.mapper.config import LiftingConfig, MultiViewConfig
from thingmap.mapper.multiview.kept_views import KeptView, ViewStack
from thingmap.mapper.multiview.observations import observe
from thingmap.mapper.multiview.sight import Sight, sight


def look(tools, cards, place, config=None, x=0.0, depth=None):
    """`Sight` of a place from one camera."""
    config = config or MultiViewConfig()
    frame = cards.frame(0, x)
    if depth is not None:
        frame.depth[:] = depth
    none = Detections.empty(tools.classes)
    observations, _ = observe(none, frame, LiftingConfig(), config)
    view = KeptView.of(frame, 0, none, observations, np.empty(0, dtype=np.int64), config.pixel_step)
    stack = ViewStack.of([view], cards.pose(x)[None], tools.camera, config.pixel_step)
    return Sight(sight(np.array([place]), stack, config)[0, 0])


@pytest.fixture
def cards(tools):
    return tools.Cards(((0.0, 0.0, 1.0), 0.1))


def test_what_is_before_a_wall_is_visible(tools, cards):
    assert look(tools, cards, (0.3, 0.0, 1.5)) is Sight.VISIBLE


def test_what_is_behind_a_card_is_hidden_until_the_camera_has_moved(tools, cards):
    assert look(tools, cards, (0.0, 0.0, 1.5)) is Sight.HIDDEN
    assert look(tools, cards, (0.0, 0.0, 1.5), x=0.4) is Sight.VISIBLE


def test_a_surface_just_before_the_centroid_may_be_its_own(tools, cards):
    assert look(tools, cards, (0.0, 0.0, 1.07)) is Sight.VISIBLE
    assert look(tools, cards, (0.0, 0.0, 1.09)) is Sight.HIDDEN


def test_an_empty_place_could_have_shown_something(tools, cards):
    assert look(tools, cards, (0.0, 0.0, 0.6)) is Sight.VISIBLE


@pytest.mark.parametrize("place", [(0.0, 0.0, -1.0), (1.0, 0.0, 1.0), (0.0, -0.8, 1.0), (0.3, 0.0, 1.8)])
def test_what_is_behind_beside_or_far_away_is_out_of_view(tools, cards, place):
    assert look(tools, cards, place, MultiViewConfig(far=1.7)) is Sight.OUT


def test_the_border_does_not_count(tools, cards):
    u = 153.0  # of 160; 5 % are 8 pixels
    place = ((u - tools.camera.cx) / tools.camera.fx * 1.5, 0.0, 1.5)
    assert look(tools, cards, place) is Sight.OUT
    assert look(tools, cards, place, MultiViewConfig(margin=0.02)) is Sight.VISIBLE


def test_where_nothing_is_read_nothing_is_known(tools, cards):
    assert look(tools, cards, (0.3, 0.0, 1.5), depth=0.0) is Sight.HIDDEN


def test_a_single_wrong_reading_hides_nothing(tools, cards):
    depth = np.full((120, 160), 2.0, dtype=np.float32)
    depth[60, 80] = 0.5  # a pixel that is kept, next to the centre
    assert look(tools, cards, (0.0, 0.0, 1.5), depth=depth) is Sight.VISIBLE
    assert look(tools, cards, (0.0, 0.0, 1.5), MultiViewConfig(window=1), depth=depth) is Sight.HIDDEN
