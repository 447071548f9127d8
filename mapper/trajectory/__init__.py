"""Camera motion: odometry, keyframes and the up direction."""
