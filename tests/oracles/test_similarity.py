"""Umeyama's closed form against implementations that others wrote and use."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.similarity import umeyama


def by_pycolmap(source, target):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed (extra: oracles)")
    fit = pycolmap.estimate_sim3d(source, target)
    return fit.scale, fit.rotation.matrix(), fit.translation


def by_evo(source, target):
    geometry = pytest.importorskip(
        "evo.core.geometry", reason="evo is not installed (extra: oracles)"
    )
    rotation, translation, scale = geometry.umeyama_alignment(source.T, target.T, with_scale=True)
    return scale, rotation, translation


def by_scikit_image(source, target):
    transform = pytest.importorskip(
        "skimage.transform", reason="scikit-image is not installed (extra: oracles)"
    )
    fit = transform.SimilarityTransform.from_estimate(source, target)
    return fit.scale, fit.params[:3, :3] / fit.scale, fit.params[:3, 3]


@pytest.mark.parametrize("oracle", [by_pycolmap, by_evo, by_scikit_image])
@pytest.mark.parametrize("noise", [0.0, 0.1], ids=["exact", "noisy"])
@pytest.mark.parametrize("count", [4, 6, 50])
def test_the_fit_equals_an_independent_one(count, noise, oracle, offset, similarity_from):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        source = rng.normal(scale=20, size=(count, 3))
        target = similarity_from(seed, offset)(source) + rng.normal(scale=noise, size=(count, 3))
        fit = umeyama(source, target)
        scale, rotation, translation = oracle(source, target)
        assert fit.scale == pytest.approx(scale, rel=1e-9)
        assert_allclose(fit.rotation, rotation, atol=1e-9)
        size = np.abs(target).max()
        assert_allclose(fit.translation, translation, atol=1e-9 * size)
        carried = scale * source @ rotation.T + translation
        assert_allclose(fit(source), carried, atol=1e-9 * size)


@pytest.mark.parametrize("oracle", [by_pycolmap, by_evo, by_scikit_image])
def test_both_frames_may_be_far_from_their_origins(oracle, offset, similarity_from):
    rng = np.random.default_rng(3)
    source = rng.normal(scale=20, size=(8, 3)) + np.array([3_000.0, -2_000, 500])
    target = similarity_from(3, offset)(source) + rng.normal(scale=0.05, size=(8, 3))
    scale, rotation, _ = oracle(source, target)
    fit = umeyama(source, target)
    assert fit.scale == pytest.approx(scale, rel=1e-9)
    assert_allclose(fit.rotation, rotation, atol=1e-9)
