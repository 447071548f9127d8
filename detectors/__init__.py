"""What turns an image into evidence."""
