"""The map while it grows: what a frame changed, and how sure the map becomes of one thing."""

from thingmap.datasets import BrokenFrame, open_sequence, usable_frames
from thingmap.detectors.spec import make_detector
from thingmap.mapper import SemanticMapper

sequence = open_sequence("sample:tabletop", stride=3, max_frames=24)
mapper = SemanticMapper(make_detector("simulated?seed=1", sequence), source=sequence.name)


def tell(broken: BrokenFrame) -> None:
    """A frame that cannot be read is skipped, and never silently."""
    print("skipped", broken)


known: dict[str, float] = {}
for frame in usable_frames(sequence, tell):
    update = mapper.process_frame(frame)
    if not update.is_keyframe:
        continue  # most frames only move the camera; keyframes are where the map changes
    for thing in mapper.object_map().things:
        before = known.get(thing.id)
        if before is None:
            print(f"{frame.stamp:5.2f} s: {thing.id} appeared, {thing.label} with P = {thing.probability:.2f}")
        elif abs(thing.probability - before) > 0.1:
            print(f"{frame.stamp:5.2f} s: {thing.id} is {thing.label} with P = {thing.probability:.2f} now")
        known[thing.id] = thing.probability

print(f"{len(known)} things; outcomes of all boxes: {mapper.statistics()['outcomes']}")
