"""Boxes in images: things projected, boxes matched, curves drawn."""
