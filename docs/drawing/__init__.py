"""A finished map as a picture, with nothing but numpy and OpenCV."""
