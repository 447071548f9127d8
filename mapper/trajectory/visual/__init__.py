"""Motion from images: features, and whole images."""
