"""Numbers of training."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..channels import Channels
from ..config import PyramidConfig


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """How templates are learned; together with the sources it decides the model to the last bit.

    Attributes:
        channels: what the templates look at.
        seed: of everything that is drawn.
        rounds: of mining, at most; a template for which a round finds nothing new is done (10: Lai et al., III-C).
        pyramid: levels on which templates are trained, and later run; up to twice the image's size, since a can across
            the room is 20 pixels wide. Three an octave: with four mean AP was the same and detection takes a third
            more.
        cells: about so many cells of 8 x 8 pixels has the window of a whole object.
        margin: room around the object in its window, as a share of the window's side, on every side: outlines need
            both of their sides.
        fit: share of the training boxes, from the median both ways, that the window's aspect is made for; the window of
            an odd one is enlarged instead.
        aspects: greatest ratio between aspects that one window is for; a class with more has several windows, in steps
            of equal ratio.
        most_windows: of a class, and
        fewest_boxes: that a window of several is made for.
        views: of a class that are learned from, at most, spread evenly.
        held_out: share of instances, views and background frames that only calibration sees.
        held_out_views: of a class, at most.
        shift: positives are displaced by up to this share of the window, as the cell grid will displace them.
        zoom: and enlarged or shrunk by up to this many octaves, half a step of the pyramid.
        composed_frames: objects of all classes put into backgrounds, to be mined like frames; only where views have
            masks and backgrounds no objects.
        other_views: of objects of other classes that are negatives from the start, for each class.
        random_windows: of every frame that are negatives from the start, for each template.
        ignored_overlap: windows with at least this intersection over union with a true object of the class (with its
            half, for templates of parts) are no negatives.
        frame_windows: hard negatives taken from one frame in one round, for each template, at most.
        round_windows: the same from all frames.
        cache: negatives that a template keeps from round to round, at most; the easiest go first.
        cost: C of the linear SVM.
        objects_per_frame: the class prior that probabilities are calibrated to: so many objects of a class in a frame
            on average, against all false detections in a frame.
        found_overlap: intersection over union from which a window shows a held-out object.
        frame_detections: false detections of a held-out frame that calibration looks at, the strongest.
        memory: bytes of images kept; the rest is read anew each time.
        workers: threads for the SVMs; has no influence on the model.
    """

    channels: Channels = Channels.RGBD
    seed: int = 0
    rounds: int = 10
    pyramid: PyramidConfig = field(default_factory=lambda: PyramidConfig(levels_per_octave=3, max_scale=2.0))
    cells: int = 48
    margin: float = 0.08
    fit: float = 0.9
    aspects: float = 2.5
    most_windows: int = 3
    fewest_boxes: int = 10
    views: int = 300
    held_out: float = 0.2
    held_out_views: int = 60
    shift: float = 0.04
    zoom: float = 0.15
    composed_frames: int = 40
    other_views: int = 200
    random_windows: int = 10
    ignored_overlap: float = 0.3
    frame_windows: int = 20
    round_windows: int = 500
    cache: int = 2000
    cost: float = 0.01
    objects_per_frame: float = 0.5
    found_overlap: float = 0.5
    frame_detections: int = 50
    memory: int = 800_000_000
    workers: int = 2
