"""A bundle opened for reading: results.json, its tables and its distances, and nothing else."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.files import read


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What a report is made from.

    Attributes
    ----------
    folder : Path
        The bundle.
    results : dict
        As in results.json.
    """

    folder: Path
    results: dict[str, Any]
    _clouds: dict[Path, PointCloud | None] = field(default_factory=dict, init=False, repr=False)

    @property
    def names(self) -> list[str]:
        """The reconstructions, in the project's order."""
        return list(self.results["reconstructions"])

    def table(self, name: str) -> pd.DataFrame:
        """Read ``data/<name>.csv``; ids stay text, also where one is "007" or "NA"."""
        path = self.folder / "data" / f"{name}.csv"
        return pd.read_csv(path, dtype={"id": str}, keep_default_na=False, na_values=[""])

    def cloud(self, name: str, direction: Literal["accuracy", "completeness"]) -> PointCloud | None:
        """Read a thinned cloud with its distances once, for every figure: none may change it.

        None where it has no points, and so no file.
        """
        path = self.folder / "clouds" / f"{name}-{direction}.laz"
        if path not in self._clouds:
            self._clouds[path] = read(path) if path.exists() else None
        return self._clouds[path]

    def picking_sigma(
        self, name: str, frame: Literal["source", "target"], role: Literal["control", "check"]
    ) -> float | None:
        """Return the root mean square of the sigmas that picks state in a frame, per axis.

        None where no pick of that role states one, or the bundle holds no picks.
        """
        if not (self.folder / "data" / f"correspondences-{name}.csv").is_file():
            return None
        table = self.table(f"correspondences-{name}")
        stated = table.loc[table["role"] == role, f"sigma_{frame}"].dropna().to_numpy(np.float64)
        return float(np.sqrt((stated**2).mean())) if len(stated) else None

    def distances(self, name: str, *keys: str) -> dict[str, NDArray[np.float64]]:
        """Read a reconstruction's distances, their heights, and the edges of the zones.

        All that is stored, or only what `keys` name: reading one takes a fraction of the time.
        """
        with np.load(self.folder / "data" / f"distances-{name}.npz", allow_pickle=False) as stored:
            return {key: stored[key] for key in keys or stored.files}


def open_evidence(folder: str | Path) -> Evidence:
    """Open a bundle."""
    folder = Path(folder)
    text = (folder / "data" / "results.json").read_text("utf-8")
    return Evidence(folder, json.loads(text))
