"""Maps on a screen: while they grow, and as a page."""
