"""Rays, light, the two cameras, and what exactly was seen."""
