"""Models of things: the seven classes, things of no class, imported scans."""
