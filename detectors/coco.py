"""The 80 classes of COCO 2017, as detectors number them (0..79) and as the dataset does (1..90, with gaps)."""

from __future__ import annotations

COCO_80: tuple[str, ...] = (
    *("person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light"),
    *("fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow"),
    *("elephant", "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee"),
    *("skis", "snowboard", "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard"),
    *("tennis racket", "bottle", "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple"),
    *("sandwich", "orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch"),
    *("potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote", "keyboard", "cell phone"),
    *("microwave", "oven", "toaster", "sink", "refrigerator", "book", "clock", "vase", "scissors", "teddy bear"),
    *("hair drier", "toothbrush"),
)
"""Class names in the order of a COCO-trained detector's outputs."""

# Ids 1..91 that the dataset announced but never annotated (street sign, hat, shoe, ...).
_NEVER_ANNOTATED = frozenset({12, 26, 29, 30, 45, 66, 68, 69, 71, 83, 91})

COCO_CATEGORY_IDS: tuple[int, ...] = tuple(i for i in range(1, 92) if i not in _NEVER_ANNOTATED)
"""The dataset's category id of each of the 80 classes: `COCO_CATEGORY_IDS[k]` belongs to `COCO_80[k]`."""

COCO_CATEGORIES: tuple[dict, ...] = tuple(
    {"id": id_, "name": name} for id_, name in zip(COCO_CATEGORY_IDS, COCO_80, strict=True)
)
"""The 80 classes as the `categories` of a COCO file."""
