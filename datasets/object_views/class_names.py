"""One name for a class, whichever way its source writes it."""

from __future__ import annotations

import re

from ..synthetic.things.scans import ALIASES


def class_name(text: str) -> str:
    """`coffee_mug` and `Coffee Mug` as "coffee mug", and `mug` as well: see `ALIASES`."""
    words = re.sub(r"[_\s]+", " ", text).strip().lower()
    return ALIASES.get(words, words)
