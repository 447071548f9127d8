"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

# the first example may compile kernels
settings.register_profile("thingmap", deadline=None)
settings.load_profile("thingmap")

REAL_DATA = Path(__file__).resolve().parents[1].parent / "shared" / "data"


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of recorded sequences beside the repository; tests that need it skip where it is absent."""
    if not REAL_DATA.is_dir():
        pytest.skip("recorded sequences (../shared/data beside the repository) are absent")
    return REAL_DATA
