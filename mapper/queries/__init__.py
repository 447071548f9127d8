"""What people ask a map of things, a module a kind of question; every answer has a probability."""
