"""Which topics of a bag are the colour, the depth aligned to it, and the camera.

A topic that the user names is taken at his word. The others are chosen where only one choice is sensible: depth is
aligned to colour where both are in one frame of ROS (`header.frame_id`) and of one size, since drivers that register
depth to colour give it the colour camera's frame. One image is often recorded both raw and compressed, as
`TOPIC`, `TOPIC/compressed` and `TOPIC/compressedDepth`: raw is taken then.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import InputError
from .bag import BadMessage, Bag, Topic
from .camera import CAMERA_INFO, info_size
from .images import COMPRESSED, IMAGE, ImageKind, decode_color, decode_depth, encoding_of, kind_of

TRANSPORTS = ("/compressed", "/compressedDepth")
LISTED = 12  # topics named in an error; `thingmap info` lists all

# RealSense aligned_depth_to_color, OpenNI and ZED depth_registered, Azure Kinect depth_to_rgb
_ALIGNED = re.compile(r"aligned_depth|depth_registered|depth_to_(rgb|color)")


@dataclass(frozen=True, slots=True)
class ImageTopic:
    """A topic of images, by its first message.

    Attributes:
        topic: of the bag.
        kind: what it shows.
        encoding: as the message writes it.
        size: (width, height) in pixels; (0, 0) where the message cannot be decoded.
        frame_id: the frame of ROS that the image is in.
    """

    topic: Topic
    kind: ImageKind
    encoding: str
    size: tuple[int, int]
    frame_id: str

    @property
    def image(self) -> str:
        """The topic without what says how it was compressed."""
        return image_of(self.topic.name)

    def __str__(self) -> str:
        width, height = self.size
        return f"{self.topic.name} ({self.encoding}, {width} x {height}, {self.topic.count})"


@dataclass(frozen=True, slots=True)
class ChosenTopics:
    """The topics that make frames.

    Attributes:
        color: images in colour, or grey where there are no others.
        depth: images of depth, aligned to `color`.
        info: name of the topic of the camera's calibration.
    """

    color: ImageTopic
    depth: ImageTopic
    info: str


def image_of(topic: str) -> str:
    """`/camera/image_raw` of `/camera/image_raw/compressed`; other topics as they are."""
    for suffix in TRANSPORTS:
        topic = topic.removesuffix(suffix)
    return topic


def image_topics(bag: Bag) -> list[ImageTopic]:
    """All topics of images that have a message, in the order of their names."""
    return [_look_at(bag, topic) for topic in bag.of_type(IMAGE, COMPRESSED)]


def choose_topics(bag: Bag, color: str | None, depth: str | None, info: str | None) -> ChosenTopics:
    """The topics named, and for those that are None the only sensible ones.

    Raises:
        InputError: there is no such topic, it is of another type, or there is not exactly one sensible choice; the
            topics found are listed.
    """
    images = image_topics(bag)
    colors = [_named(bag, images, color)] if color else _in_color(images)
    depths = [_named(bag, images, depth)] if depth else _once([i for i in images if i.kind is ImageKind.DEPTH])
    pairs = [(c, d) for c in colors for d in depths if (color and depth) or _fit(c, d)]
    if len(pairs) > 1:
        pairs = [pair for pair in pairs if _ALIGNED.search(pair[1].image)] or pairs
    if len(pairs) > 1:  # an image without distortion is as good as the one it was made from, and needs no work
        pairs = [pair for pair in pairs if is_rectified(pair[0])] or pairs
    if len(pairs) != 1:
        raise _undecided(bag, images, len(pairs))
    chosen_color, chosen_depth = pairs[0]
    return ChosenTopics(chosen_color, chosen_depth, _choose_info(bag, info, chosen_color))


def is_rectified(image: ImageTopic) -> bool:
    """Whether its name says that distortion was removed: `image_rect`, `image_rect_color`, ..."""
    return "rect" in image.image.rsplit("/", 1)[-1].split("_")


def _look_at(bag: Bag, topic: Topic) -> ImageTopic:
    try:
        message = bag.first(topic.name)
    except BadMessage:
        return ImageTopic(topic, ImageKind.OTHER, "first message damaged", (0, 0), "")
    kind = kind_of(message)
    if hasattr(message, "width"):
        size = (int(message.width), int(message.height))
    else:
        try:
            image = decode_depth(message) if kind is ImageKind.DEPTH else decode_color(message)
        except BadMessage:
            size = (0, 0)
        else:
            size = (image.shape[1], image.shape[0])
    return ImageTopic(topic, kind, encoding_of(message), size, str(message.header.frame_id))


def _in_color(images: Iterable[ImageTopic]) -> list[ImageTopic]:
    """Topics in colour; the grey ones where there is none, for they may be infrared."""
    images = list(images)
    colors = [i for i in images if i.kind is ImageKind.COLOR]
    return _once(colors or [i for i in images if i.kind is ImageKind.GREY])


def _once(images: Iterable[ImageTopic]) -> list[ImageTopic]:
    """One topic for each image: raw before compressed."""
    best: dict[str, ImageTopic] = {}
    for candidate in sorted(images, key=lambda i: (i.topic.type != IMAGE, i.topic.name)):
        best.setdefault(candidate.image, candidate)
    return list(best.values())


def _fit(color: ImageTopic, depth: ImageTopic) -> bool:
    """Whether depth seems aligned to colour; a damaged first message and a frame left empty do not speak against it."""
    same_size = color.size == depth.size or (0, 0) in (color.size, depth.size)
    same_frame = color.frame_id == depth.frame_id or not (color.frame_id and depth.frame_id)
    return same_size and same_frame


def _named(bag: Bag, images: Iterable[ImageTopic], name: str) -> ImageTopic:
    images = list(images)
    for candidate in images:
        if candidate.topic.name == name:
            return candidate
    found = str(bag.topics[name]) if name in bag.topics else f"no topic {name}"
    listed = f"{found}; topics of images: {_list(images)}"
    raise InputError(bag.path, f"images in {name}", listed, "name one of these")


def _choose_info(bag: Bag, name: str | None, color: ImageTopic) -> str:
    infos = bag.of_type(CAMERA_INFO)
    names = [topic.name for topic in infos]
    if name:
        if name in names:
            return name
        found = ", ".join(str(topic) for topic in infos) or "no topic of this type"
        raise InputError(bag.path, f"{CAMERA_INFO} messages in {name}", found, "name one of these")
    beside = color.image.rsplit("/", 1)[0] + "/camera_info"
    if beside in names:
        return beside
    fitting = [topic.name for topic in infos if _is_of(bag, topic.name, color)]
    if len(fitting) == 1:
        return fitting[0]
    found = ", ".join(str(topic) for topic in infos) or "no topic of this type"
    remedy = f"name the topic with info=TOPIC, or record {beside}"
    raise InputError(bag.path, f"one topic of {CAMERA_INFO} that belongs to {color.topic.name}", found, remedy)


def _is_of(bag: Bag, info: str, color: ImageTopic) -> bool:
    try:
        message = bag.first(info)
    except BadMessage:
        return False
    return message.header.frame_id == color.frame_id and info_size(message) == color.size


def _undecided(bag: Bag, images: list[ImageTopic], pairs: int) -> InputError:
    colors, depths = _in_color(images), [i for i in images if i.kind is ImageKind.DEPTH]
    found = f"{pairs} that could be" if pairs else "none"
    if not pairs and colors and depths:
        frames = ", ".join(f"{i.topic.name} is in {i.frame_id or 'no frame'}" for i in (colors[0], depths[0]))
        found += f" (depth must share the frame and the size of colour: {frames})"
    listed = _list(images) or ", ".join(str(topic) for topic in bag.topics.values()) or "no topic at all"
    remedy = f'name the topics: "{bag.path.name}?color=TOPIC&depth=TOPIC&info=TOPIC"'
    return InputError(
        bag.path, "one topic of colour and one of depth aligned to it", f"{found}; found topics: {listed}", remedy
    )


def _list(images: list[ImageTopic]) -> str:
    more = f" and {len(images) - LISTED} more" if len(images) > LISTED else ""
    return ", ".join(str(image) for image in images[:LISTED]) + more
