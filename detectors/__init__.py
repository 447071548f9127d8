"""What turns an image into evidence."""

from .detections import Detections, Part
from .detector import Detector

__all__ = ["Detections", "Detector", "Part"]
