"""PointCloud: float64 points about an origin, with their attributes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray

from trigpoint.crs import parse_crs
from trigpoint.similarity import Points, Similarity

# Attribute triples that are directions and turn with the cloud, by the names that formats use.
NORMALS = (
    ("nx", "ny", "nz"),
    ("normal_x", "normal_y", "normal_z"),
    ("NormalX", "NormalY", "NormalZ"),
    ("nor_x", "nor_y", "nor_z"),
)


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points in metres (or source units) about an origin.

    Attributes
    ----------
    xyz : ndarray of shape (n, 3)
        float64, relative to `origin`.
    origin : ndarray of shape (3,)
        float64. Absolute coordinates are ``xyz + origin``.
    attributes : mapping of str to ndarray of shape (n,) or (n, k)
        As the file names them, in the file's own types.
    crs : pyproj.CRS or None
        What the file (or the caller) says. Coordinates are in metres whatever its units are.
    faces : ndarray of shape (m, 3) or None
        Triangles of a mesh, as indices into the points.
    """

    xyz: Points
    origin: NDArray[np.float64]
    attributes: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    crs: pyproj.CRS | None = None
    faces: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        """Count the points."""
        return len(self.xyz)

    @property
    def coordinates(self) -> Points:
        """Absolute coordinates, shape (n, 3)."""
        return self.xyz + self.origin

    def about(self, origin: NDArray[np.float64]) -> PointCloud:
        """Express the same points about another origin."""
        return replace(self, xyz=self.xyz + (self.origin - origin), origin=origin)

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> PointCloud:
        """Keep some points, by mask or by position; the faces of a mesh are not kept."""
        attributes = {name: values[index] for name, values in self.attributes.items()}
        return replace(self, xyz=self.xyz[index], attributes=attributes, faces=None)

    def transformed(
        self,
        similarity: Similarity,
        *,
        crs: str | pyproj.CRS | None = None,
        origin: NDArray[np.float64] | None = None,
    ) -> PointCloud:
        """Carry the cloud through a similarity: points moved, normals turned, the rest kept.

        Parameters
        ----------
        similarity : Similarity
            Maps this cloud's frame to the new one.
        crs : str or pyproj.CRS, optional
            What the new frame is, such as ``EPSG:32615``.
        origin : ndarray of shape (3,), optional
            Origin of the result; by default where the old origin goes, to the metre.
        """
        if len(self) and not np.isfinite(similarity.matrix).all():
            message = "The similarity holds NaN or infinite numbers."
            raise ValueError(message)
        moved_origin = similarity(self.origin[None, :])[0]
        origin = np.round(moved_origin) if origin is None else origin
        local = Similarity(similarity.scale, similarity.rotation, moved_origin - origin)
        attributes = dict(self.attributes)
        for triple in NORMALS:
            if all(name in attributes for name in triple):
                old = np.column_stack([attributes[name] for name in triple]).astype(np.float64)
                turned = similarity.turn(old)
                for axis, name in enumerate(triple):
                    attributes[name] = turned[:, axis].astype(attributes[name].dtype)
        return PointCloud(local(self.xyz), origin, attributes, parse_crs(crs), self.faces)


def cloud_from(
    coordinates: ArrayLike,
    *,
    attributes: Mapping[str, NDArray[np.generic]] | None = None,
    crs: str | pyproj.CRS | None = None,
) -> PointCloud:
    """Build a PointCloud from absolute coordinates of shape (n, 3).

    Examples
    --------
    >>> cloud = cloud_from([[500_000.25, 5_400_000.5, 200.0]])
    >>> cloud.origin.tolist(), cloud.xyz.tolist()
    ([500000.0, 5400000.0, 200.0], [[0.25, 0.5, 0.0]])
    """
    points = np.asarray(coordinates, np.float64).reshape(-1, 3)
    origin = np.floor(points.min(axis=0)) if len(points) else np.zeros(3)
    return PointCloud(points - origin, origin, attributes or {}, parse_crs(crs))


def concatenate(clouds: Sequence[PointCloud]) -> PointCloud:
    """Join clouds of the same frame about the first one's origin; shared attributes are kept."""
    first = clouds[0]
    if len(clouds) == 1:
        return first
    names = [name for name in first.attributes if all(name in c.attributes for c in clouds)]
    return PointCloud(
        np.concatenate([cloud.about(first.origin).xyz for cloud in clouds]),
        first.origin,
        {name: np.concatenate([cloud.attributes[name] for cloud in clouds]) for name in names},
        first.crs,
    )
