"""Textures: procedural surfaces, printed labels, finishes of a room."""
