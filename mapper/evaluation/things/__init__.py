"""Things matched with true objects, and how they differ."""
