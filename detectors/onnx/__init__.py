"""Detectors that are ONNX networks of the YOLO kind."""

from .detector import OnnxDetector

__all__ = ["OnnxDetector"]
