"""Things and the map of them."""
