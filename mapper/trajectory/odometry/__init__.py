"""Camera motion from frame to frame: one module a way of measuring it."""
