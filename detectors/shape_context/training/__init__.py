"""Learns codebooks of shape contexts from views of objects (Georgakis et al., section III-A)."""
