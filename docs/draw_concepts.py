"""Draws the pictures of docs/concepts.md as SVG: `python docs/draw_concepts.py -o docs/pictures`.

The curves are computed, not drawn: sizes from the shipped table of classes, existence by Bayes' rule.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from drawing.svg import Svg

import thingmap.factors.size_table as size_table

BLUE, RED, GREEN, GREY, ORANGE = "#2b6cb0", "#c53030", "#2f855a", "#718096", "#c05621"
CLASSES = (("cup", BLUE), ("bowl", GREEN), ("soda can", ORANGE))
HEIGHT = (math.log(0.105), 0.12)  # mean and deviation of the log height that the views measured
APPEARANCE = (0.45, 0.35, 0.2)  # of the three classes, by the detector's scores alone
FOUND, FALSE = 0.8, 0.1  # P(a box there | an object that can be seen), P(a box there | none)
VIEWS = "sshhhhhmmmm"  # supported, hidden, missed


def graph() -> str:
    """The variables and what ties them."""
    svg = Svg(760, 330)
    poses = [(120 + 170 * i, 95) for i in range(4)]
    things = [(205, 235), (460, 235)]
    for i in range(3):
        svg.factor(poses[i], poses[i + 1], "odometry" if i == 0 else "", BLUE)
    svg.curve(poses[0], poses[3], -58, BLUE, "loop closure")
    for pose, thing in ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (3, 1)):
        svg.factor(poses[pose], things[thing], "box and depth" if (pose, thing) == (3, 1) else "", GREEN)
    for i, (x, y) in enumerate(poses):
        svg.node((x, y), f"X{i}", BLUE)
    for j, (x, y) in enumerate(things, start=1):
        svg.factor((x, y), (x + 75, y), "", GREEN)
        svg.factor((x + 75, y), (x + 150, y), "EP" if j == 2 else "", ORANGE)
        svg.node((x, y), f"L{j}", GREEN)
        svg.node((x + 75, y), f"S{j}", GREEN)
        svg.node((x + 150, y), f"c{j}", ORANGE)
        svg.text((x, y + 42), "position", GREY)
        svg.text((x + 75, y + 42), "size", GREY)
        svg.text((x + 150, y + 42), "class", GREY)
    svg.factor(poses[0], (55, 180), "planes", RED)
    svg.node((55, 180), "U", RED)
    svg.text((55, 222), "up", GREY)
    svg.text((380, 315), "circles are what is estimated, squares are what was measured", GREY)
    return svg.document("The factor graph: poses, up, and position, size and class of every object")


def visibility() -> str:
    """What one view's depth says of a volume behind another thing."""
    svg = Svg(760, 300)
    camera = (60.0, 150.0)
    svg.polygon([(35, 130), (35, 170), (60, 160), (60, 140)], GREY)
    svg.text((48, 195), "camera", GREY)
    svg.box((300, 202), (70, 110), GREY, "a box in front", below=True)
    svg.box((540, 140), (110, 170), GREEN, "the object's volume", dashed=True)
    svg.line((700, 20), (700, 280), GREY)
    svg.text((700, 296), "wall", GREY)
    for slope, end, colour in (
        (-0.155, 485, GREEN),
        (-0.115, 485, GREEN),
        (-0.07, 485, GREEN),
        (-0.05, 700, RED),
        (0.0, 265, GREY),
        (0.06, 265, GREY),
        (0.1, 265, GREY),
    ):
        to = (end, camera[1] + slope * (end - camera[0]))
        svg.line(camera, to, colour)
        svg.dot(to, colour)
    svg.text((250, 40), "agrees: a surface where the object's should be", GREEN)
    svg.text((250, 60), "free: seen through, which speaks against it", RED)
    svg.text((150, 240), "occluded: says nothing", GREY)
    return svg.document("Rays of one view end on the object, pass through it, or are stopped in front of it")


def class_and_size() -> str:
    """The posterior over three classes before and after the measured height has its say."""
    table = size_table.read_size_table(Path(size_table.__file__).with_name("class_sizes.yaml"))
    priors = [(math.log(table[name].size[2]), table[name].spread[2]) for name, _ in CLASSES]
    mean, deviation = HEIGHT
    # log ∫ N(s; prior) N(s; measured) ds: the evidence that expectation propagation gives each class
    widths = np.array([math.hypot(deviation, spread) for _, spread in priors])
    evidence = np.exp(-0.5 * ((np.array([m for m, _ in priors]) - mean) / widths) ** 2) / widths
    after = np.array(APPEARANCE) * evidence / np.sum(np.array(APPEARANCE) * evidence)
    svg = Svg(760, 300)
    low, high, base, top = math.log(0.03), math.log(0.25), 240.0, 40.0
    heights = np.linspace(low, high, 200)
    curves = [(name, colour, m, s) for (name, colour), (m, s) in zip(CLASSES, priors, strict=True)]
    tallest = max(1.0 / s for *_, s in [*curves, ("", "", mean, deviation)])
    for name, colour, m, s in [*curves, ("measured", RED, mean, deviation)]:
        density = np.exp(-0.5 * ((heights - m) / s) ** 2) / s / tallest
        x = 40 + (heights - low) / (high - low) * 400
        svg.path(list(zip(x, base - density * (base - top), strict=True)), colour, dashed=name == "measured")
    svg.line((40, base), (440, base), GREY)
    for centimetres in (4, 6, 8, 10, 15, 20):
        x = 40 + (math.log(centimetres / 100) - low) / (high - low) * 400
        svg.line((x, base), (x, base + 5), GREY)
        svg.text((x, base + 20), f"{centimetres}", GREY)
    svg.text((240, base + 42), "height, cm (logarithmic); dashed: what the views measured", GREY)
    for column, (title, values) in enumerate((("scores alone", APPEARANCE), ("with the size", after))):
        left = 500 + 130 * column
        svg.text((left + 50, 60), title, GREY)
        for row, ((name, colour), p) in enumerate(zip(CLASSES, values, strict=True)):
            y = 90 + 50 * row
            svg.bar((left, y), 90 * float(p), colour)
            svg.text((left, y + 32), f"{name} {p:.2f}", colour, anchor="start")
    return svg.document("Priors of three classes' heights, a measured height, and the class before and after it")


def existence() -> str:
    """P(it exists) over views that found it, could not see it, and missed it."""
    svg = Svg(760, 280)
    odds, values = 0.0, [0.5]
    for view in VIEWS:
        odds += {"s": math.log(FOUND / FALSE), "h": 0.0, "m": math.log((1 - FOUND) / (1 - FALSE))}[view]
        values.append(1.0 / (1.0 + math.exp(-odds)))
    step = 660 / len(VIEWS)
    points = [(60 + step * i, 220 - 180 * p) for i, p in enumerate(values)]
    for p in (0.0, 0.5, 1.0):
        svg.line((60, 220 - 180 * p), (720, 220 - 180 * p), "#cbd5e0")
        svg.text((40, 224 - 180 * p), f"{p:g}", GREY)
    svg.path(points, BLUE)
    names = {"s": ("found", GREEN), "h": ("hidden", GREY), "m": ("missed", RED)}
    for view, point in zip(VIEWS, points[1:], strict=True):
        svg.dot(point, names[view][1])
        svg.text((point[0], 245), names[view][0], names[view][1])
    svg.text((390, 270), "views", GREY)
    return svg.document("Existence rises where it is found, stays while it is hidden, falls where it should be seen")


PICTURES = {"graph": graph, "visibility": visibility, "class_and_size": class_and_size, "existence": existence}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the pictures")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        (folder / f"{name}.svg").write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
