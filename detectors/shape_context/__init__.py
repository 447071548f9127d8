"""A detector of untextured things: shape contexts vote for centres, proposals prune the votes (Georgakis et al.)."""
