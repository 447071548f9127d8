"""How sure people are taken to be of what they say, where they do not say that too."""

from __future__ import annotations

MOVE_STD = 0.02  # m along every axis: what a tape measure in a room, held by hand, comes to
RESIZE_STD = 0.01  # m of every extent: what a ruler, held to a thing by hand, comes to
SAID_PROBABILITY = 0.99  # of a label that a person gives; people mistake one thing in a hundred for another
