"""A second look at the windows that templates propose: which class they show, if any, and where its box is."""
