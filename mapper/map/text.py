"""Numbers of a map as people read them, the same in tables and in pictures."""

from __future__ import annotations


def probability_text(probability: float) -> str:
    """Two digits, and never a certainty that is not there: 1.00 and 0.00 are said of 1 and 0 alone."""
    if 0.99 < probability < 1.0:
        return ">0.99"
    return "<0.01" if 0.0 < probability < 0.01 else f"{probability:.2f}"
