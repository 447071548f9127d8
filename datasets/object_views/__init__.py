"""Views of single objects, and backgrounds without them: what detectors are trained from."""
