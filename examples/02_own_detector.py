"""A detector of your own is any callable from a frame to its detections.

This one finds saturated colours by OpenCV alone: boxes around blobs, with a score for every class. A network's output
goes through `Detections.from_supervision`, `.from_ultralytics` or `.from_coco` in the same place.
"""

import cv2
import numpy as np

from thingmap.datasets import Frame, open_sequence
from thingmap.detectors import Detections
from thingmap.mapper import SemanticMapper

CLASSES = ("soda can", "cup")  # names that factors/class_sizes.yaml knows bring their sizes with them


def find_colourful(frame: Frame) -> Detections:
    """Blobs of strong colour: red ones are rather cans, others rather cups."""
    hue, saturation, value = cv2.split(cv2.cvtColor(frame.color, cv2.COLOR_RGB2HSV))
    mask = ((saturation > 150) & (value > 60) & (frame.depth > 0)).astype(np.uint8)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(mask)
    xyxy, scores = [], []
    for i in range(1, count):
        x, y, width, height, area = boxes[i]
        if area < 400:
            continue
        red = float(np.mean(np.abs(((hue[labels == i].astype(int) + 90) % 180) - 90) < 12))
        xyxy.append((x, y, x + width, y + height))
        scores.append((0.2 + 0.5 * red, 0.6 - 0.5 * red))  # the whole vector: the mapper weighs all classes
    if not xyxy:
        return Detections.empty(CLASSES)
    return Detections(CLASSES, np.array(xyxy, dtype=float), np.clip(scores, 0.05, 0.95))


sequence = open_sequence("sample:tabletop", stride=3, max_frames=15)
mapper = SemanticMapper(find_colourful, source=sequence.name)
boxes = 0
for frame in sequence:
    boxes += len(find_colourful(frame).xyxy)
    mapper.process_frame(frame)

# Blobs are a poor detector. Those that views agree about become things; the others stay doubtful, and `object_map()`
# without `include_doubtful`, as every file that is written, leaves out what rather does not exist.
things = mapper.object_map(include_doubtful=True)
print(f"{boxes} boxes in {len(sequence)} frames became {len(things)} things")
for thing in things.things:
    print(f"{thing.id}: exists with P = {thing.existence:.2f}, {thing.label} with P = {thing.probability:.2f}")
