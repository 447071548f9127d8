"""Packages whose names are imported when asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

import thingmap.datasets
import thingmap.mapper


@pytest.mark.parametrize("package", [thingmap.datasets, thingmap.mapper])
def test_all_public_names_are_there(package):
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match=f"{package.__name__!r} has no attribute 'Nothing'"):
        _ = package.Nothing


def test_a_map_is_read_without_what_makes_maps():
    heavy = ("numba", "gtsam", "scipy.sparse", "open3d", "cv2")
    code = (
        "import sys; from thingmap.datasets import UserError; from thingmap.mapper import ObjectMap; "
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
