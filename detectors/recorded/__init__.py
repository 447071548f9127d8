"""Detections read from files: one module a format, and our own lossless one, which is also written."""

from .detector import RecordedDetections
from .formats import RecordedFormat
from .recording import MatchedBy
from .thingmap_json import write_detections

__all__ = ["MatchedBy", "RecordedDetections", "RecordedFormat", "write_detections"]
