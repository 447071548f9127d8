"""Tests import `views_of_volumes` and `convex_bodies` from their own folder."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
