"""What a detector does when objects are hidden, learned from sequences whose objects are known."""
