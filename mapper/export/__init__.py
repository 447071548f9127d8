"""Files for other tools, a module a format."""
