"""The similarity as a linear adjustment of seven parameters.

Parameters, in this order everywhere: ln scale; small rotations about the target's x, y and z (rad,
applied after the rotation); position of the picks' target centroid (m). A point at offset p from
that centroid then moves by ``p dlns + w x p + dc``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.similarity import Points, Similarity


def _motion() -> NDArray[np.float64]:
    # motion[axis, parameter, term]: how a parameter moves a point along an axis, as a coefficient
    # of the terms (1, px, py, pz). It is the derivative at the fitted similarity, written once.
    motion = np.zeros((3, 7, 4))
    for axis in range(3):
        motion[axis, 0, 1 + axis] = 1.0
        motion[axis, 4 + axis, 0] = 1.0
        ahead, behind = (axis + 1) % 3, (axis + 2) % 3
        motion[axis, 1 + ahead, 1 + behind] = 1.0  # the cross product, one axis at a time
        motion[axis, 1 + behind, 1 + ahead] = -1.0
    return motion


MOTION = _motion()


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """The linearised least-squares problem whose solution the similarity is.

    Attributes
    ----------
    centroid : ndarray of shape (3,)
        Weighted centroid of the targets, metres.
    design : ndarray of shape (n, 3, 7)
        How the seven parameters move each pick.
    weights : ndarray of shape (n,)
        As used in the fit, scaled to mean 1.
    residuals : ndarray of shape (n, 3)
        Target minus carried source, metres.
    cofactor : ndarray of shape (7, 7)
        Inverse of the normal matrix: the covariance, were every pick's variance 1 / weight.
    leverage : ndarray of shape (n, 3, 3)
        Share of a pick's own error that the fit swallows: the diagonal blocks of the hat matrix.
    """

    centroid: NDArray[np.float64]
    design: NDArray[np.float64]
    weights: NDArray[np.float64]
    residuals: Points
    cofactor: NDArray[np.float64]
    leverage: NDArray[np.float64]

    @property
    def redundancy(self) -> NDArray[np.float64]:
        """Share of a pick's own error that shows in its residual, (n, 3, 3); traces sum to 3n-7.

        ``solve(redundancy[i], residuals[i])`` is the residual that pick would have, had it been
        left out of the fit (to first order).
        """
        return np.eye(3) - self.leverage

    def covariance(self, variances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariance (7, 7) of the parameters for picks with these variances per axis, (n,) in m².

        It holds for any weights: where they are not the inverse variances, the fit is not the
        best one, and this is the covariance of the fit that was made.
        """
        noise = normal_matrix(self.design, self.weights**2 * variances)
        return _symmetric(self.cofactor @ noise @ self.cofactor)

    def residual_covariance(self, variances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariance (n, 3, 3) of each pick's residual for picks with these variances, in m²."""
        spread = carried(self.design, self.covariance(variances))
        return variances[:, None, None] * (np.eye(3) - 2 * self.leverage) + spread

    def misfit(self, variances: NDArray[np.float64]) -> float:
        """Sum of squared residuals in units of their variances, as the best fit would leave it.

        It follows a chi-square law with 3n-7 degrees of freedom whatever the fit's own weights.
        """
        own = np.einsum("ni,n->", self.residuals**2, 1 / variances)
        pull = np.einsum("nia,n,ni->a", self.design, 1 / variances, self.residuals)
        shift = _inverse(normal_matrix(self.design, 1 / variances)) @ pull
        return max(float(own - pull @ shift), 0.0)


def linearise(
    source: Points, target: Points, similarity: Similarity, weights: NDArray[np.float64]
) -> Adjustment:
    """Linearise the fit of a similarity at its solution.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        The pairs it was fitted to; `target` in metres.
    similarity : Similarity
        The fit.
    weights : ndarray of shape (n,)
        As used in the fit; only their ratios count.

    Returns
    -------
    Adjustment
    """
    weights = weights / weights.mean()
    carried_source = similarity(source)
    share = (weights / weights.sum())[:, None]
    centroid = target[0] + (share * (target - target[0])).sum(axis=0)
    design = design_matrix(carried_source - centroid)
    cofactor = _inverse(normal_matrix(design, weights))
    leverage = weights[:, None, None] * carried(design, cofactor)
    return Adjustment(centroid, design, weights, target - carried_source, cofactor, leverage)


def design_matrix(offsets: Points) -> NDArray[np.float64]:
    """Return how the parameters move points at offsets (n, 3) from the centroid: (n, 3, 7)."""
    terms = np.column_stack([np.ones(len(offsets)), offsets])
    design: NDArray[np.float64] = np.einsum("iam,nm->nia", MOTION, terms)
    return design


def normal_matrix(design: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of ``weight * design.T @ design`` over the picks: (7, 7)."""
    # einsum, here and elsewhere: a BLAS product's last bits may depend on the thread count.
    normal: NDArray[np.float64] = np.einsum("nia,n,nib->ab", design, weights, design)
    return normal


def carried(design: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) of points that parameters of this covariance (7, 7) carry."""
    half = np.einsum("nia,ab->nib", design, covariance)
    full: NDArray[np.float64] = np.einsum("nia,nja->nij", half, design)
    return full


def _inverse(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    # Metres and radians differ by the size of the site: even them out before inverting.
    size = 1 / np.sqrt(np.diag(normal))
    return _symmetric(np.linalg.inv(normal * np.outer(size, size)) * np.outer(size, size))


def _symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return (matrix + matrix.T) / 2
