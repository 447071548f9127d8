"""Reports: a file, a page, the terminal, comparisons. They show any protocol and know none."""
