"""What turns files into frames; the synthetic world."""
