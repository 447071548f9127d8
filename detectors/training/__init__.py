"""What learning a detector needs, whatever the detector: which views and frames, and how they are kept."""
