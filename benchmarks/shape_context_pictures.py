"""Draws what the shape-context detector does in an image: proposals, edges, votes of one class, heat, and the answer.

uv run python benchmarks/shape_context_pictures.py -o DIR                          a rendered table
uv run python benchmarks/shape_context_pictures.py -o DIR --show SEQUENCE --class "coffee mug"
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from edges import drawn
from proposal_pictures import write

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.detectors.shape_context.detector import ScoredProposals, ShapeContextDetector
from thingmap.detectors.shape_context.edges import find_edges
from thingmap.detectors.shape_context.model import shipped_model

SYNTHETIC = "synth:tabletop?seed=3&clutter=medium"
WHITE, YELLOW, PALE = (255, 255, 255), (255, 255, 0), (120, 150, 255)
LEAST = 0.5  # probability from which a proposal is named


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw one image; 2 for a user's mistake."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("-o", "--out", type=Path, required=True, metavar="DIR", help="where pictures go")
    add("--show", default=SYNTHETIC, metavar="SEQUENCE", help=f"default: {SYNTHETIC}")
    add("--frame", type=int, default=0, metavar="N", help="which of its frames (default 0)")
    add("--class", dest="label", default="soda can", metavar="NAME", help="whose votes are drawn")
    add("--model", type=Path, default=shipped_model(), metavar="FILE", help="instead of the shipped one")
    options = parser.parse_args(arguments)
    try:
        detector, frame = ShapeContextDetector(options.model), open_sequence(options.show)[options.frame]
        if options.label not in detector.classes:
            raise UserError(f"--class {options.label}: the model knows {', '.join(detector.classes)}")
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    scored, number = detector.score(frame), detector.classes.index(options.label)
    edges = find_edges(frame.color, frame.depth, within=scored.proposals.labels >= 0)
    upper = np.hstack([with_proposals(frame, scored), drawn(frame.color, edges)])
    lower = np.hstack([with_votes(frame, scored, number), named(frame, scored, detector.classes)])
    write(options.out / f"shape-context-{frame.name}.png", np.vstack([upper, lower]))
    return 0


def with_proposals(frame: Frame, scored: ScoredProposals) -> np.ndarray:
    """The image darkened, each proposal that is looked at in a colour of its own."""
    shades = np.random.default_rng(0).integers(60, 255, (len(scored.looked_at) + 1, 3)).astype(np.uint8)
    shades[~np.append(scored.looked_at, False)] = 0
    labels = scored.proposals.labels
    on = (labels >= 0) & np.append(scored.looked_at, False)[labels]
    picture = frame.color // 2
    picture[on] = frame.color[on] // 3 + shades[labels[on]] // 3 * 2
    return picture


def with_votes(frame: Frame, scored: ScoredProposals, number: int) -> np.ndarray:
    """Valid votes of a class as dots, brighter by weight, its hypotheses as crosses with their boxes."""
    picture = np.ascontiguousarray(frame.color // 3)
    votes, found = scored.scores.votes[number], scored.scores.hypotheses[number]
    heat = np.zeros(picture.shape[:2], np.float32)
    x, y = np.round(votes.xy).astype(int).T
    np.add.at(heat, (y, x), votes.weight)
    heat = cv2.GaussianBlur(heat, (0, 0), 2.0)
    share = (heat / max(float(heat.max()), 1e-9))[..., None]
    picture = (picture + share * (np.array(YELLOW) - picture)).astype(np.uint8)
    for middle, box in zip(found.xy.astype(int).tolist(), found.xyxy.astype(int).tolist(), strict=True):
        cv2.drawMarker(picture, middle, WHITE, cv2.MARKER_CROSS, 9, 1)
        cv2.rectangle(picture, box[:2], box[2:], PALE, 1)
    return picture


def named(frame: Frame, scored: ScoredProposals, classes: Sequence[str]) -> np.ndarray:
    """Boxes of the proposals that are probably of a class, with the class."""
    picture = np.ascontiguousarray(frame.color.copy())
    best = scored.probability[:, :-1].argmax(axis=1)
    for k in np.flatnonzero(scored.looked_at & (scored.probability[:, :-1].max(axis=1) >= LEAST)):
        box = scored.proposals.xyxy[k].astype(int).tolist()
        cv2.rectangle(picture, box[:2], box[2:], WHITE, 1)
        text = f"{classes[best[k]]} {scored.probability[k, best[k]]:.2f}"
        place = (box[0] + 1, max(box[1] - 3, 9))
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 2, cv2.LINE_AA)
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.38, YELLOW, 1, cv2.LINE_AA)
    return picture


if __name__ == "__main__":
    sys.exit(main())
