"""What protocols are given: a finished run, the truth, and how the two lie to each other."""
