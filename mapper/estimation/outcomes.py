"""What became of detections, tracks and landmarks; every outcome is counted and reported."""

from __future__ import annotations

from enum import Enum


class Outcome(Enum):
    """One per detection and keyframe, or per change of a track or landmark."""

    # detections
    LOW_CONFIDENCE = "detection below the confidence threshold"
    PART_UNUSED = "detection of an object part, where parts are switched off"
    NO_DEPTH = "detection without enough depth readings"
    OUT_OF_RANGE = "detection beyond the depth range"
    ASSOCIATED = "detection of a landmark"
    TRACKED = "detection of a candidate"
    DUPLICATE = "second box on the same object"
    NEW_TRACK = "detection that starts a candidate"
    ADRIFT = "detection while the camera did not know its place"
    # candidates
    PROMOTED = "candidate became a landmark"
    REJECTED_MISSED = "candidate dropped: missed where it should have been seen"
    REJECTED_FREE_SPACE = "candidate dropped: seen through"
    # landmarks and views
    SUPPORTED = "landmark seen"
    FULLY_OCCLUDED = "landmark hidden in this view"
    UNCLEAR = "landmark in sight, too small or too much hidden to be found for sure"
    MISSED = "landmark missed where it should have been seen"
    SEEN_THROUGH = "landmark's volume is empty in this view"
    OUT_OF_VIEW = "landmark outside the image"
    MERGED = "landmark merged into another"
    SEPARATED = "landmark parted from one that had been taken for it"
    RETIRED = "landmark retired: no object"
