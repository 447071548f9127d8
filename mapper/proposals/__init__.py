"""Places and sizes of objects proposed from their detections, and refined until they agree with them."""
