"""HOG sliding windows on colour and depth, with a template for every part (Lai et al. 2012; Meger et al. 2011)."""
