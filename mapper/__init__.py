"""The loop, the back end, the map and what people do with it."""
