"""Every point labelled: a Markov random field over voxels (Lai, Bo, Ren, Fox 2012, section III-B)."""
