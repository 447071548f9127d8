"""One HTML file that shows a map and needs nothing else."""
