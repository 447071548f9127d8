"""How well keyframes are recognised by appearance: revisits found, false candidates, time and memory.

uv run python benchmarks/places.py                                                       rendered laps
uv run python benchmarks/places.py --sequence ../shared/data/redkitchen --stride 2 --gap 60    any sequence with poses
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from results import show_section, table
from scipy.spatial import KDTree

from thingmap.datasets.errors import UserError
from thingmap.datasets.frame import Frame
from thingmap.datasets.open import open_sequence
from thingmap.mapper.config import PlaceConfig, VisualConfig
from thingmap.mapper.trajectory.loops.place_index import PlaceIndex
from thingmap.mapper.trajectory.loops.vocabulary import Vocabulary, packed
from thingmap.mapper.trajectory.visual.features import FeatureExtractor, Features

TITLE = "Places"
LAPS = "synth:laps?seed=1&frames=1800"
NEAR, ANGLE, OVERLAP = 0.5, np.radians(30.0), 0.3  # m, rad, share of features: a revisit
APART = 0.1  # share of features below which a candidate is false
SAME = 0.2  # m between points of two images that show the same surface
NOISE = 8.0  # grey levels, added to a query; a camera's own are about 2
FLIPPED = 0.04  # of the bits: a feature seen again
SIZES = (300, 1000, 3000)  # keyframes at which time and memory are read
Names = Callable[[int], list[int]]  # candidates for a keyframe, best first


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Keyframes of a sequence.

    Attributes:
        features: of every keyframe.
        noisy: the same from images with further noise.
        overlap: (K, K) share of the features of a row's keyframe that a column's sees too.
        revisit: (K, K) bool, the column's is one that the row's should be recognised as.
        gap: keyframes; only those at least so many earlier are looked for.
    """

    features: list[Features]
    noisy: list[Features]
    overlap: np.ndarray
    revisit: np.ndarray
    gap: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write if asked to; 2 for a user's mistake."""
    options = _options(arguments)
    cv2.setNumThreads(1)
    try:
        sequence = open_sequence(options.sequence, stride=options.stride)
        if sequence.poses is None:
            raise UserError(
                f"{options.sequence}: expected poses to know revisits by, found none; give another sequence"
            )
        frames = [sequence[i] for i in range(len(sequence)) if np.isfinite(sequence.poses[i]).all()]
        poses = sequence.poses[[frame.index for frame in frames]]
        recording = record(frames, poses, options.gap)
        if not recording.revisit.any():
            raise UserError(
                f"{options.sequence}: expected a place seen twice, found none; try another --stride or --gap"
            )
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    show_section(f"{TITLE}: {sequence.name}", describe(recording), options.write)
    return 0


def record(frames: Sequence[Frame], poses: np.ndarray, gap: int) -> Recording:
    """Features of frames with (K, 4, 4) poses, and which of them see the same."""
    extract, rng = FeatureExtractor(VisualConfig()), np.random.default_rng(0)
    features = [extract(frame) for frame in frames]
    noisy = [extract(replace(frame, color=_with_noise(frame.color, rng))) for frame in frames]
    overlap = _overlap(features, poses)
    turn = np.einsum("aij,bij->ab", poses[:, :3, :3], poses[:, :3, :3])  # trace of the rotation between two
    near = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=2) < NEAR
    near &= turn > 1.0 + 2.0 * np.cos(ANGLE)
    earlier = np.arange(len(poses))[None, :] <= np.arange(len(poses))[:, None] - gap
    return Recording(features, noisy, overlap, near & earlier & (overlap > OVERLAP), gap)


def _with_noise(color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(color + NOISE * rng.normal(size=color.shape), 0, 255).astype(np.uint8)


def _overlap(features: list[Features], poses: np.ndarray) -> np.ndarray:
    clouds = [f.points @ T[:3, :3].T + T[:3, 3] for f, T in zip(features, poses, strict=True)]
    some = np.stack([cloud[np.linspace(0, len(cloud) - 1, 60).astype(int)] for cloud in clouds])
    seen = [KDTree(cloud).query(some.reshape(-1, 3), distance_upper_bound=SAME)[0] < SAME for cloud in clouds]
    return np.stack([column.reshape(len(some), -1).mean(axis=1) for column in seen], axis=1)


def describe(recording: Recording) -> str:
    """Markdown: recognition, then time and memory."""
    clean, noisy = recording.features, recording.noisy
    open_threshold = PlaceConfig(min_score=-1.0)
    rows = [
        ("place index", *_recognised(recording, _index(recording, clean, PlaceConfig()))),
        ("- without its threshold", *_recognised(recording, _index(recording, clean, open_threshold))),
        (f"- queries with {NOISE:.0f} grey levels of noise", *_recognised(recording, _index(recording, noisy))),
        ("histograms of the same words", *_recognised(recording, _histograms(recording))),
    ]
    head = ("method", "recall@1", "recall@5", "candidates a query", "of them false")
    count = int(recording.revisit.any(axis=1).sum())
    return (
        f"{len(clean)} keyframes, {np.mean([len(f) for f in clean]):.0f} features each; {count} see again what one "
        f"at least {recording.gap} earlier saw from within {NEAR} m and 30 degrees. A candidate is false when fewer "
        f"than a tenth of the features are common.\n\n"
        + table(head, rows)
        + f"\n\nTime and memory, the same keyframes again with {100 * FLIPPED:.0f} % of their bits flipped:\n\n"
        + table(("keyframes", "add ms", "query ms", "kB a keyframe"), _paces(clean))
    )


def _index(recording: Recording, queries: list[Features], config: PlaceConfig | None = None) -> Names:
    """Asks an index that grows with the keyframes; ask in order."""
    index = PlaceIndex(config or PlaceConfig())

    def names(q: int) -> list[int]:
        while len(index) < q:
            index.add(len(index), recording.features[len(index)].descriptors)
        return [m.keyframe for m in index.query(queries[q].descriptors, exclude_after=q - recording.gap)]

    return names


def _histograms(recording: Recording) -> Names:
    """The usual bag of words, for comparison: tf-idf histograms, the share that two have in common."""
    vocabulary = Vocabulary.load()
    counts = np.stack(
        [np.bincount(vocabulary.words(packed(f.descriptors)), minlength=4096) for f in recording.features]
    )
    weighted = counts * np.log((len(counts) + 1) / ((counts > 0).sum(axis=0) + 1))
    weighted /= weighted.sum(axis=1, keepdims=True)

    def names(q: int) -> list[int]:
        common = np.minimum(weighted[: q - recording.gap + 1], weighted[q]).sum(axis=1)
        return [int(k) for k in np.argsort(-common, kind="stable")[:5]]

    return names


def _recognised(recording: Recording, names: Names) -> tuple[str, str, str, str]:
    first, five, named, false = [], [], [], []
    for q in range(recording.gap, len(recording.features)):
        candidates = names(q)
        named.append(len(candidates))
        false.append(int((recording.overlap[q, candidates] < APART).sum()))
        if recording.revisit[q].any():
            found = recording.revisit[q, candidates]
            first.append(bool(found[:1].any()))
            five.append(bool(found.any()))
    return f"{np.mean(first):.3f}", f"{np.mean(five):.3f}", f"{np.mean(named):.2f}", f"{np.mean(false):.2f}"


def _paces(features: list[Features]) -> Iterator[tuple[str, ...]]:
    """Time in one thread, of the CPU."""
    rng, index = np.random.default_rng(0), PlaceIndex(PlaceConfig())
    adding: list[float] = []
    for number in range(max(SIZES)):
        bits = np.unpackbits(features[number % len(features)].descriptors, axis=1)
        descriptors = np.packbits(bits ^ (rng.random(bits.shape) < FLIPPED), axis=1)
        adding.append(_time(lambda n=number, d=descriptors: index.add(n, d)))
        if number + 1 in SIZES:
            asking = [_time(lambda f=f: index.query(f.descriptors)) for f in features[:: max(len(features) // 20, 1)]]
            last = adding[-100:]
            yield (
                str(number + 1),
                f"{1e3 * np.median(last):.2f}",
                f"{1e3 * np.median(asking):.2f}",
                f"{index.nbytes / len(index) / 1e3:.0f}",
            )


def _time(work: Callable[[], object]) -> float:
    started = time.thread_time()
    work()
    return time.thread_time() - started


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--sequence", default=LAPS, help=f"with poses (default {LAPS})")
    add("--stride", type=int, default=6, metavar="N", help="every n-th frame is a keyframe (default 6)")
    add("--gap", type=int, default=30, metavar="N", help="keyframes between a place and its revisit (default 30)")
    add("--write", action="store_true", help="put the results into RESULTS.md")
    options = parser.parse_args(arguments)
    if options.gap < 1:
        parser.error("--gap counts from 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
