"""What becomes of tracks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from thingmap.mapper.config import MultiViewConfig
from thingmap.mapper.multiview.assessment import Fate, assess
from thingmap.mapper.multiview.sight import Sight


def test_views_that_agree_count_once_per_view():
    """A track of one view and one of three that say the same: the posteriors differ, what views say does not."""
    one = np.log([0.8, 0.1, 0.1])
    log_posterior = np.stack([one, 3 * one])
    log_posterior -= np.logaddexp.reduce(log_posterior, axis=1, keepdims=True)
    views = [SimpleNamespace(track=np.array(tracks)) for tracks in ([0, 1], [1], [1])]
    sights = np.full((2, 3), Sight.HIDDEN)
    found = assess(log_posterior, np.zeros((2, 3)), views, sights, MultiViewConfig())  # type: ignore[arg-type]
    np.testing.assert_allclose(found.per_view, [[0.8, 0.1, 0.1]] * 2)
    assert found.posterior[0, 0] == pytest.approx(0.8) and found.posterior[1, 0] > 0.99
    assert found.fates == (Fate.KEPT, Fate.KEPT)
