"""Probabilities and covariances against what is true."""
