"""Rooms with their furniture, and where things can stand in them."""
