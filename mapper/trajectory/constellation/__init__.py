"""Places recognised by the things in them."""
