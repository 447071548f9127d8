"""The model: one file per factor, each with its equation."""
