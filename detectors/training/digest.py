"""Tells one set of views and frames from another."""

from __future__ import annotations

from hashlib import sha256
from itertools import chain

from ...datasets.object_views.backgrounds import Backgrounds
from ...datasets.object_views.object_view import ObjectViews


def names_digest(views: ObjectViews, backgrounds: Backgrounds) -> str:
    """16 hexadecimal digits of the names of all views and frames: others differ where their numbers are equal."""
    names = chain((entry.name for entry in views.entries), backgrounds.names)
    return sha256("\n".join(names).encode()).hexdigest()[:16]
