"""Inference over a fixed set of views, as both papers of Meger et al. do it."""
