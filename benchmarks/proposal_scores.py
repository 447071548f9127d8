"""Not a benchmark: fits the objectness that the proposal detector ships (detectors/proposals/objectness.json).

uv run python benchmarks/proposal_scores.py --write

Logistic regression on rendered scenes of seeds below 1000, the label being whether a proposal overlaps the pixels
of one thing, of a class or clutter, by half or more. Half of the scenes fit, the other half says how honest the
probabilities are; the shipped numbers are fitted to all. To be run again when the proposals change; about 10 minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from proposal_truth import match, rendered
from results import table
from scipy.optimize import minimize
from scipy.special import expit

from thingmap.detectors.proposals.config import ProposalConfig
from thingmap.detectors.proposals.objectness import FEATURES, SHIPPED, Objectness, proposal_features
from thingmap.detectors.proposals.proposals import find_proposals

PRESETS = ("tabletop", "kitchen", "tabletop", "survey")
LEVELS = ("low", "medium", "high")
FIRST_SEED, FRAMES = 500, 5
RIDGE = 1.0  # weight of a standardised feature's square, in nats


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """(N, F) features, (N,) whether a thing, (N,) number of the scene."""

    features: np.ndarray
    right: np.ndarray
    scene: np.ndarray


def main(arguments: Sequence[str] | None = None) -> int:
    """Render, fit, say how honest it is, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--write", action="store_true", help="replace the shipped numbers")
    options = parser.parse_args(arguments)
    samples = collect(scenes(options.scenes))
    half = samples.scene // 4 % 2 == 0  # presets come in fours and levels in threes: both halves have all
    model = fit(samples.features[half], samples.right[half])
    print(report(model(samples.features[~half]), samples.right[~half]))
    model = fit(samples.features, samples.right)
    print(table(("feature", "weight"), zip(FEATURES, [f"{w:.2f}" for w in model.weights], strict=True)))
    if options.write:
        model.save(SHIPPED)
    return 0


def scenes(count: int) -> list[str]:
    """Lines of synthetic scenes, of every preset and level of clutter."""
    kinds = zip(range(count), cycle(PRESETS), cycle(LEVELS), strict=False)
    return [f"synth:{preset}?seed={FIRST_SEED + k}&clutter={level}" for k, preset, level in kinds]


def collect(lines: list[str]) -> Samples:
    """Proposals of all scenes."""
    config = ProposalConfig()
    features, right, scene = [], [], []
    for line, frame, instances, objects in rendered(lines, FRAMES):
        found = find_proposals(frame, config)
        features.append(proposal_features(found, config))
        right.append(match(found, instances, frame.depth, objects).right)
        scene.append(np.full(len(found), lines.index(line)))
        print(f"{line} {frame.name}: {len(found)} proposals, {right[-1].sum()} things", file=sys.stderr, flush=True)
    return Samples(np.concatenate(features), np.concatenate(right), np.concatenate(scene))


def fit(features: np.ndarray, right: np.ndarray) -> Objectness:
    """Most likely weights under a weak Gaussian prior on standardised features."""
    mean, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-6)
    x = np.column_stack([(features - mean) / spread, np.ones(len(features))])
    sign = np.where(right, 1.0, -1.0)

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        margin = sign * (x @ w)
        penalty = 0.5 * RIDGE * w[:-1] @ w[:-1]
        gradient = -x.T @ (sign * expit(-margin)) + RIDGE * np.append(w[:-1], 0.0)
        return float(np.logaddexp(0.0, -margin).sum() + penalty), gradient

    w = minimize(loss, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 500}).x
    weights = w[:-1] / spread
    return Objectness(round(float(w[-1] - weights @ mean), 4), tuple(round(float(v), 4) for v in weights))


def report(probability: np.ndarray, right: np.ndarray) -> str:
    """How often proposals of each probability are things, and the area under the ROC curve."""
    bins = np.minimum((probability * 10).astype(int), 9)
    rows = [
        (
            f"{b / 10:.1f}-{(b + 1) / 10:.1f}",
            int((bins == b).sum()),
            f"{probability[bins == b].mean():.2f}",
            f"{right[bins == b].mean():.2f}",
        )
        for b in range(10)
        if (bins == b).any()
    ]
    rank = np.argsort(np.argsort(probability, kind="stable"), kind="stable") + 1
    many, few = right.sum(), (~right).sum()
    area = (rank[right].sum() - many * (many + 1) / 2) / max(many * few, 1)
    share = np.bincount(bins, minlength=10) / len(bins)
    gap = [abs(probability[bins == b].mean() - right[bins == b].mean()) if share[b] else 0.0 for b in range(10)]
    head = f"{len(right)} proposals, {many} things; ROC area {area:.3f}, calibration error {share @ gap:.3f}"
    return f"{head}\n\n{table(('probability', 'proposals', 'mean', 'things'), rows)}\n"


if __name__ == "__main__":
    sys.exit(main())
