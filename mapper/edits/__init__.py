"""What people correct in a map: recorded, undoable, kept."""
