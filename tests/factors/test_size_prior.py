"""Size priors: sums over yaw against Monte Carlo, evidence against numerical integrals, lookup of names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thingmap.detectors.coco import COCO_80
from thingmap.factors.size_prior import CORRELATION, FIT_SIGMA, WIDE_SIGMA, load_size_priors, marginal
from thingmap.factors.size_table import SizeEntry

RARELY_INDOORS = {
    *("car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light", "fire hydrant", "stop sign"),
    *("parking meter", "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe", "skis", "snowboard", "kite"),
    "surfboard",
}
TABLE_TOP = ("bowl", "cap", "cereal_box", "coffee_mug", "soda_can", "flashlight", "bottle", "food_can", "ball")


def sampled_moments(entry: SizeEntry, count: int = 60_000) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of log half-axes of things drawn at random and turned at random."""
    rng = np.random.default_rng(0)
    common = rng.normal(size=(count, 1))
    own = rng.normal(size=(count, 3))
    if entry.round:
        own[:, 1] = own[:, 0]
    standard = np.sqrt(CORRELATION) * common + np.sqrt(1 - CORRELATION) * own
    size = np.array(entry.size) * np.exp(np.array(entry.spread) * standard)
    vertical = rng.choice(3, size=count, p=entry.resting)
    yaw = rng.uniform(-np.pi, np.pi, count)
    c, s = np.cos(yaw), np.sin(yaw)
    half = np.empty((count, 3))
    for up in range(3):
        here = vertical == up
        across, along = (size[here, i] for i in range(3) if i != up)
        corners = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) / 2.0
        x = np.max([a * across * c[here] - b * along * s[here] for a, b in corners], axis=0)
        y = np.max([a * across * s[here] + b * along * c[here] for a, b in corners], axis=0)
        if entry.round and up == 2:
            angle = np.linspace(0, 2 * np.pi, 181)[:, None]
            rim = np.cos(angle) * across / 2, np.sin(angle) * along / 2
            x = (rim[0] * c[here] - rim[1] * s[here]).max(axis=0)
            y = (rim[0] * s[here] + rim[1] * c[here]).max(axis=0)
        half[here] = np.stack([x, y, size[here, up] / 2.0], axis=1)
    return np.log(half).mean(axis=0), np.cov(np.log(half).T) + FIT_SIGMA**2 * np.eye(3)


@pytest.mark.parametrize(
    "entry",
    [
        SizeEntry((0.22, 0.15, 0.03), (0.2, 0.15, 0.4), False, (0.4, 0.05, 0.55), (), ""),
        SizeEntry((1.4, 0.8, 0.75), (0.3, 0.2, 0.05), False, (0.0, 0.0, 1.0), (), ""),
        SizeEntry((0.19, 0.02, 0.015), (0.1, 0.2, 0.3), False, (0.0, 0.0, 1.0), (), ""),
        SizeEntry((0.08, 0.08, 0.25), (0.2, 0.2, 0.2), True, (0.2, 0.0, 0.8), (), ""),
        SizeEntry((0.3, 0.2, 0.1), (0.1, 0.1, 0.1), True, (0.0, 0.0, 1.0), (), ""),
    ],
    ids=["book", "table", "fork", "bottle", "oval"],
)
def test_yaw_and_poses_are_summed_out(entry):
    mean, covariance = marginal(entry)
    sampled_mean, sampled_covariance = sampled_moments(entry)
    np.testing.assert_allclose(mean, sampled_mean, atol=0.015)
    np.testing.assert_allclose(covariance, sampled_covariance, atol=0.02 * max(1.0, np.abs(sampled_covariance).max()))
    assert np.linalg.eigvalsh(covariance)[0] >= FIT_SIGMA**2 - 1e-12


def test_a_round_thing_has_its_own_size_whatever_the_yaw():
    mean, covariance = marginal(SizeEntry((0.1, 0.1, 0.3), (0.2, 0.2, 0.1), True, (0.0, 0.0, 1.0), (), ""))
    np.testing.assert_allclose(np.exp(mean), [0.05, 0.05, 0.15], rtol=1e-6)
    expected = np.array([[0.04, 0.04, 0.01], [0.04, 0.04, 0.01], [0.01, 0.01, 0.01]]) + FIT_SIGMA**2 * np.eye(3)
    np.testing.assert_allclose(covariance, expected, atol=1e-9)


def test_a_square_box_is_seen_larger_than_its_side():
    """By the mean of log(cos yaw + sin yaw) over a quarter turn."""
    mean, _ = marginal(SizeEntry((0.5, 0.5, 0.5), (1e-3, 1e-3, 1e-3), False, (0.0, 0.0, 1.0), (), ""))
    yaw = (np.arange(100_000) + 0.5) * np.pi / 200_000
    expected = np.log(0.25) + np.mean(np.log(np.cos(yaw) + np.sin(yaw)))
    np.testing.assert_allclose(mean, [expected, expected, np.log(0.25)], atol=1e-5)


# ---- evidence --------------------------------------------------------------------------------------------------------


def integrals(mean, covariance, information, vector) -> tuple[float, np.ndarray, np.ndarray]:
    """log Z, mean and covariance of N(s; mean, covariance) exp(-s' information s / 2 + vector' s) on a grid."""
    precision = np.linalg.inv(covariance) + information
    spread = np.linalg.cholesky(np.linalg.inv(precision))
    center = np.linalg.solve(precision, np.linalg.solve(covariance, mean) + vector)
    line = np.linspace(-7.0, 7.0, 35)
    unit = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    s = center + (1.1 * unit + 0.3) @ spread.T  # neither centred nor scaled as the answer
    d = s - mean
    log_f = -0.5 * ((d @ np.linalg.inv(covariance)) * d).sum(axis=1) - 0.5 * ((s @ information) * s).sum(axis=1)
    log_f += s @ vector - 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(covariance)[1]
    weight = np.exp(log_f - log_f.max())
    cell = (line[1] - line[0]) ** 3 * 1.1**3 * np.linalg.det(spread)
    m = weight @ s / weight.sum()
    return log_f.max() + np.log(weight.sum() * cell), m, (weight * (s - m).T) @ (s - m) / weight.sum()


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 3]), st.floats(-1.0, 3.0))
def test_evidence_is_the_integral(seed, rank, log_scale):
    """For cavities of full rank, of rank 1, and empty ones."""
    rng = np.random.default_rng(seed)
    priors = load_size_priors(["bottle", "book", "chair"])
    root = 10.0 ** (log_scale / 2.0) * rng.normal(size=(3, rank)) if rank else np.zeros((3, 1))
    information = root @ root.T
    vector = information @ (priors.mean[1] + 0.3 * rng.normal(size=3))
    log_z, means, covariances = priors.log_evidence(information, vector)
    exact = [integrals(m, C, information, vector) for m, C in zip(priors.mean, priors.covariance, strict=True)]
    np.testing.assert_allclose(log_z - log_z[0], [z - exact[0][0] for z, _, _ in exact], atol=1e-3)
    np.testing.assert_allclose(means, [m for _, m, _ in exact], atol=1e-3)
    np.testing.assert_allclose(covariances, [C for _, _, C in exact], atol=1e-3)


def test_without_a_measurement_every_class_keeps_its_prior():
    priors = load_size_priors(["bottle", "book"])
    log_z, means, covariances = priors.log_evidence(np.zeros((3, 3)), np.zeros(3))
    np.testing.assert_allclose(log_z, 0.0, atol=1e-12)
    np.testing.assert_allclose(means, priors.mean)
    np.testing.assert_allclose(covariances, priors.covariance)


def test_numerical_noise_in_the_cavity_does_not_matter():
    priors = load_size_priors(["bottle", "book"])
    information, noise = np.diag([50.0, 0.0, 0.0]), np.array([[0, 1e-9, 0], [0, -1e-7, 0], [0, 0, -1e-8]])
    vector = np.array([-150.0, 0.0, 0.0])
    for clean, noisy in zip(
        priors.log_evidence(information, vector), priors.log_evidence(information + noise, vector), strict=True
    ):
        np.testing.assert_allclose(noisy, clean, atol=1e-5)
    log_z, _, _ = priors.log_evidence(np.eye(3) * 1e8, 1e8 * priors.mean[1])
    assert np.isfinite(log_z).all() and log_z[1:-1].argmax() == 0


def test_size_tells_a_mug_from_a_chair():
    classes = ("coffee mug", "chair", "soda can", "refrigerator")
    priors = load_size_priors(classes)
    information = np.eye(3) / 0.1**2
    for size, expected in [((0.12, 0.11, 0.09), 0), ((0.6, 0.62, 0.9), 1), ((0.066, 0.067, 0.12), 2)]:
        log_half = np.log(np.array(size) / 2.0)
        log_z, _, _ = priors.log_evidence(information, information @ log_half)
        assert classes[log_z[1:].argmax()] == classes[expected]
        assert log_z[1 + expected] > log_z[0]
    log_half = np.log([1.5, 0.02, 0.9])  # a plank upright is none of them
    assert priors.log_evidence(information, information @ log_half)[0].argmax() == 0


# ---- names -----------------------------------------------------------------------------------------------------------


def test_coco_and_table_top_classes_are_known():
    priors = load_size_priors(COCO_80)
    assert {name for name, known in zip(COCO_80, priors.known, strict=True) if not known} == RARELY_INDOORS
    assert load_size_priors(TABLE_TOP).known.all()
    assert priors.mean.shape == (82, 3) and priors.covariance.shape == (82, 3, 3)
    assert np.linalg.eigvalsh(priors.covariance).min() > 0.0


def test_not_an_object_is_wide_and_in_the_middle():
    priors = load_size_priors(["bottle", "chair"])
    np.testing.assert_allclose(priors.mean[0], priors.mean[1:3].mean(axis=0))
    np.testing.assert_allclose(priors.covariance[0], WIDE_SIGMA**2 * np.eye(3))


def test_an_unknown_class_is_like_no_object():
    priors = load_size_priors(["bottle", "left-handed gadget"])
    assert priors.known.tolist() == [True, False]
    np.testing.assert_array_equal(priors.mean[2], priors.mean[0])
    log_z, _, _ = priors.log_evidence(np.eye(3) * 30.0, np.array([-90.0, -60.0, 10.0]))
    assert log_z[2] == pytest.approx(log_z[0])
    nothing_known = load_size_priors(["gadget"])
    assert np.isfinite(nothing_known.mean).all() and not nothing_known.known.any()
    assert load_size_priors([]).mean.shape == (2, 3)


def test_anything_is_wide_whatever_no_object_is():
    """The last row stays the wide Gaussian where the size of what is no object is known."""
    known = np.array([-3.0, -3.0, -4.0]), 0.2 * np.eye(3)
    plain, learned = load_size_priors(["bottle", "gadget"]), load_size_priors(["bottle", "gadget"], background=known)
    assert len(plain.mean) == len(learned.mean) == 4
    for priors in (plain, learned):
        np.testing.assert_array_equal(priors.mean[-1], plain.mean[0])
        np.testing.assert_array_equal(priors.covariance[-1], WIDE_SIGMA**2 * np.eye(3))
        np.testing.assert_array_equal(priors.mean[2], priors.mean[0])  # of an unknown class size says nothing
    np.testing.assert_array_equal(learned.mean[0], known[0])
    np.testing.assert_array_equal(learned.covariance[0], known[1])
    np.testing.assert_array_equal(learned.mean[1], plain.mean[1])


def test_aliases_and_spelling():
    priors = load_size_priors(["Mug", "coffee_mug", "Sofa", "couch"])
    np.testing.assert_array_equal(priors.mean[1], priors.mean[2])
    np.testing.assert_array_equal(priors.mean[3], priors.mean[4])


def test_a_users_file_adds_replaces_and_takes_names(tmp_path: Path):
    extra = tmp_path / "mine.yaml"
    extra.write_text(
        "gadget: {size: [0.4, 0.4, 0.8], spread: 0.1, footprint: round}\n"
        "bottle: {size: [0.2, 0.2, 0.6], spread: 0.1, footprint: round, aliases: [cup]}\n"
    )
    priors = load_size_priors(["gadget", "bottle", "cup", "bowl"], extra)
    assert priors.known.all()
    np.testing.assert_allclose(np.exp(priors.mean[1]), [0.2, 0.2, 0.4], rtol=1e-3)
    np.testing.assert_allclose(np.exp(priors.mean[2]), [0.1, 0.1, 0.3], rtol=1e-3)
    np.testing.assert_array_equal(priors.mean[3], priors.mean[2])
    np.testing.assert_array_equal(priors.mean[4], load_size_priors(["bowl"]).mean[1])


def test_scanned_objects_fit_their_class(real_data: Path):
    """The meshes' extents, turned to several yaws, lie within three standard deviations of their class."""
    scanned = {
        "003_cracker_box": "cereal box",
        "004_sugar_box": "food box",
        "005_tomato_soup_can": "food can",
        "006_mustard_bottle": "bottle",
        "013_apple": "apple",
        "024_bowl": "bowl",
        "025_mug": "coffee mug",
        "029_plate": "plate",
    }
    priors = load_size_priors(list(scanned.values()))
    for row, folder in enumerate(scanned, start=1):
        mesh = next((real_data / "ycb" / folder).rglob("*.obj"))
        vertices = np.array([line.split()[1:4] for line in mesh.open() if line.startswith("v ")], dtype=float)
        for yaw in np.radians([0.0, 30.0, 60.0, 90.0]):
            c, s = np.cos(yaw), np.sin(yaw)
            turned = vertices @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
            off = np.log(np.ptp(turned, axis=0) / 2.0) - priors.mean[row]
            assert off @ np.linalg.solve(priors.covariance[row], off) < 3.0**2 + 3.0, folder
