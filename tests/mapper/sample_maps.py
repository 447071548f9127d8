"""What tests do with a mapper of the rendered sample: feed it, and read all that it says."""

from __future__ import annotations

import json
from collections.abc import Iterable

from thingmap.datasets.frame import Frame
from thingmap.detectors.detections import Detections
from thingmap.mapper.config import MapperConfig, OdometryConfig, OdometrySource
from thingmap.mapper.map.object_map import ObjectMap
from thingmap.mapper.mapper import SemanticMapper

GIVEN_POSES = MapperConfig(odometry=OdometryConfig(source=OdometrySource.POSES))


def feed(mapper: SemanticMapper, frames: Iterable[Frame], detections: Iterable[Detections]) -> SemanticMapper:
    for frame, found in zip(frames, detections, strict=True):
        mapper.process_frame(frame, found)
    return mapper


def as_text(object_map: ObjectMap) -> str:
    """Everything that a map says, to the last bit."""
    things = [
        [t.id, t.label, t.probability, t.existence, dict(t.class_posterior), t.first_seen, t.last_seen, str(t.evidence)]
        + [a.tolist() for a in (t.position, t.position_covariance, t.size, t.size_std)]
        for t in object_map.things
    ]
    return json.dumps([things, object_map.classes, object_map.source, str(object_map.frame), str(object_map.up)])


def assert_readable(mapper: SemanticMapper) -> None:
    """Every question gets an answer."""
    mapper.object_map(include_doubtful=True)
    stamps, poses = mapper.trajectory()
    assert len(stamps) == len(poses)
    mapper.cloud()
    json.dumps(mapper.statistics())
