from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trigpoint import minimal
from trigpoint.minimal import all_triples, draw_triples, fit_triples, score
from trigpoint.similarity import umeyama


def generator(seed):
    return np.random.Generator(np.random.PCG64(seed))


def noisy_picks(similarity, seed, count=9, noise=0.1):
    rng = np.random.default_rng(seed)
    source = rng.normal(scale=8, size=(count, 3))
    return source, similarity(source) + rng.normal(scale=noise, size=(count, 3))


@pytest.mark.parametrize("seed", range(5))
def test_every_triple_gets_the_fit_that_umeyama_gives_it(seed, offset, similarity_from):
    source, target = noisy_picks(similarity_from(seed, offset), seed)
    triples = all_triples(len(source))
    fits = fit_triples(source, target, triples)
    assert fits.sound.all()
    for triple, matrix, shift, misfit in zip(
        triples, fits.matrix, fits.shift, fits.misfit, strict=True
    ):
        fit = umeyama(source[triple], target[triple])
        assert_allclose(matrix, fit.scale * fit.rotation, atol=1e-8)
        carried = (source - source[0]) @ matrix.T + shift + target[0]
        assert_allclose(carried, fit(source), atol=1e-7)
        left = np.linalg.norm(target - fit(source), axis=1)[triple]
        assert_allclose(misfit, left, atol=1e-7)


def test_trap_3_a_triangle_is_turned_over_never_mirrored():
    triangle = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])
    fits = fit_triples(triangle, triangle * [-1, 1, 1], np.array([[0, 1, 2]]))
    assert np.linalg.det(fits.matrix[0]) == pytest.approx(1)
    assert_allclose(fits.misfit, 0, atol=1e-12)


@pytest.mark.parametrize("flat", ["source", "target"])
@pytest.mark.parametrize("factor", [1e-3, 1, 1e3])
def test_triples_on_a_line_are_not_sound_in_any_units(flat, factor, offset):
    line = np.arange(4)[:, None] * np.array([0.3, 0.5, 0.8])
    bent = np.vstack([line, [[5.0, 0, 0]]])
    spread = np.random.default_rng(1).normal(size=(5, 3))
    pair = (bent * factor, spread) if flat == "source" else (spread, bent * factor)
    triples = all_triples(5)
    fits = fit_triples(pair[0], pair[1] + offset, triples)
    on_the_line = (triples < 4).all(axis=1)
    assert not fits.sound[on_the_line].any()
    assert fits.sound[~on_the_line].any()


def test_two_picks_in_one_place_make_no_sound_triple():
    source = np.array([[0.0, 0, 0], [0, 0, 0], [4, 0, 0], [0, 3, 0]])
    target = np.array([[0.0, 0, 0], [9, 0, 0], [4, 0, 0], [0, 3, 0]])
    sound = fit_triples(source, target, all_triples(4)).sound
    assert sound.tolist() == [False, False, True, True]  # 012, 013 hold both; 023, 123 one


def test_trap_2_triangles_too_unlike_for_any_scale_are_not_sound():
    # A point midway between two, against a point far from two neighbours.
    needle = np.array([[0.0, 0, 0], [5, 0.01, 0], [10, 0, 0]])
    other = np.array([[0.0, 0, 0], [10, 0, 0], [0.1, 0.01, 0]])
    assert not fit_triples(needle, other, np.array([[0, 1, 2]])).sound.any()
    assert fit_triples(needle, 1e-4 * needle, np.array([[0, 1, 2]])).sound.all()


def test_drawn_triples_are_distinct_sorted_and_equally_likely():
    drawn = draw_triples(6, 20_000, generator(1))
    counts = Counter(map(tuple, drawn.tolist()))
    assert set(counts) == set(combinations(range(6), 3))
    share = np.array(list(counts.values())) / 1000  # 20 sets, 1,000 each expected
    assert abs(share - 1).max() < 0.15


def test_more_trials_begin_with_the_same_draws():
    assert_array_equal(draw_triples(9, 50, generator(7)), draw_triples(9, 500, generator(7))[:50])


def test_three_picks_leave_one_draw():
    assert (draw_triples(3, 100, generator(0)) == [0, 1, 2]).all()


def test_scores_do_not_depend_on_the_batch(monkeypatch, similarity_from, offset):
    source, target = noisy_picks(similarity_from(2, offset), 2, count=30)
    fits = fit_triples(source, target, all_triples(30))
    whole = score(source, target, fits, threshold=0.5)
    monkeypatch.setattr(minimal, "BATCH", 70)
    for one, other in zip(whole, score(source, target, fits, threshold=0.5), strict=True):
        assert one.tobytes() == other.tobytes()


def test_scores_are_what_the_fit_leaves(similarity_from):
    source, target = noisy_picks(similarity_from(4), 4)
    target[2] += 3
    triples = all_triples(len(source))
    bits, counts, squares = score(
        source, target, fit_triples(source, target, triples), threshold=0.5
    )
    for row, triple in enumerate(triples):
        left = np.linalg.norm(target - umeyama(source[triple], target[triple])(source), axis=1)
        assert_array_equal(np.unpackbits(bits[row], count=9).astype(bool), left <= 0.5)
        assert counts[row] == (left <= 0.5).sum()
        assert squares[row] == pytest.approx((left[left <= 0.5] ** 2).sum())
