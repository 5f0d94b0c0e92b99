"""Canonical JSON: plain values, rounded the same way every time, written whole or not at all."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

LENGTH_DIGITS = 9
OTHER_DIGITS = 12
# Keys of lengths that no '_m' marks: they lie in the target frame, in metres.
LENGTHS = frozenset({"translation", "x", "y", "z", "from", "to", "low", "high"})


def plain(value: Any, key: str = "") -> Any:
    """Return a value as JSON has it: lengths to 1e-9 m, others to 1e-12, NaN as None.

    A covariance keeps twelve significant digits instead.

    Parameters
    ----------
    value : object
        A mapping, sequence, array, DataFrame (its rows become objects) or scalar.
    key : str, optional
        The name it stands under; names that end in ``_m`` hold metres.

    Examples
    --------
    >>> plain({"rmse_m": np.float64(0.12345678949), "mean_m": [float("nan"), -1e-15]})
    {'rmse_m': 0.123456789, 'mean_m': [None, 0.0]}
    """
    if isinstance(value, pd.DataFrame):
        return [plain(row) for row in value.to_dict(orient="records")]
    if isinstance(value, Mapping):
        return {str(name): plain(item, str(name)) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), key)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item, key) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        number = float(value)
        if not math.isfinite(number):
            return None
        if key == "covariance":  # of squares so small that decimal places would lose them
            return float(f"{number:.{OTHER_DIGITS - 1}e}") + 0.0
        digits = LENGTH_DIGITS if key.endswith("_m") or key in LENGTHS else OTHER_DIGITS
        return round(number, digits) + 0.0  # no negative zero
    return None if value is None else str(value)


def to_json(results: Mapping[str, Any]) -> str:
    """Return results as canonical JSON text: the same results are the same bytes."""
    return json.dumps(plain(results), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a text file beside its place, then rename it: nothing half-written is left.

    Raises
    ------
    OSError
        If the folder can't be written to.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        error.filename = str(path)  # not the one beside it, which nobody has heard of
        raise
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        Path(name).chmod(0o666 & ~_umask())
        Path(name).replace(path)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise


def _umask() -> int:
    # Only setting it reads it; mkstemp's own 0600 would hide the file from the user's colleagues.
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
