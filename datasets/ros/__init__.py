"""Recordings of ROS 1 and ROS 2, read without ROS."""

from .open import find_bags, open_bag

__all__ = ["find_bags", "open_bag"]
