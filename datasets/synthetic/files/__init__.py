"""Synthetic sequences on disk."""
