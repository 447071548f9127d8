"""Learns HOG templates from views of objects and images of backgrounds (Lai et al. 2012, sections III-C and IV-A)."""
