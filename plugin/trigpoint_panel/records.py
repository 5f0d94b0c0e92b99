"""The records in a session file, each checked as it is read: pairs, an adopted similarity."""

from __future__ import annotations

from typing import Any, NoReturn

from trigpoint.picks import FARTHEST, LARGEST_SIGMA, SMALLEST_SIGMA
from trigpoint_panel.pairs import ROLES, Pair, Pairs, Place
from trigpoint_panel.state import Adopted


class NotSessionError(ValueError):
    """What is wrong with a document, to be said with its file's name."""


def pair_table(pair: Pair) -> dict[str, Any]:
    """Return a pair as a session file holds it."""
    return {
        "id": pair.id,
        "role": pair.role,
        "source": pair.source,
        "target": pair.target,
        "sigma_source": pair.sigma_source,
        "sigma_target": pair.sigma_target,
        "note": pair.note,
        "extra": pair.extra,
    }


def pairs_in(document: dict[str, Any], key: str) -> Pairs:
    """Read the pairs that stand under a key."""
    pairs = tuple(_pair(row) for row in typed(document, key, list))
    names = [pair.id for pair in pairs]
    for name in names:
        if names.count(name) > 1:
            refuse(f"two of its pairs are named {name!r}")
    return pairs


def _pair(row: Any) -> Pair:
    if not isinstance(row, dict) or not isinstance(name := row.get("id"), str) or not name.strip():
        refuse("one of its pairs has no id")
    role = row.get("role", "control")
    if role not in ROLES:
        refuse(f"pair {name!r} has the role {shown(role)}")
    note, extra = row.get("note", ""), row.get("extra", [])
    if not isinstance(note, str):
        refuse(f"pair {name!r} has a note that is no text")
    if not isinstance(extra, list) or not all(
        isinstance(cell, list) and len(cell) == 2 and all(isinstance(part, str) for part in cell)
        for cell in extra
    ):
        refuse(f"pair {name!r} has columns that are no text")
    return Pair(
        name,
        role,
        _place(row.get("source"), name),
        _place(row.get("target"), name),
        _sigma(row.get("sigma_source"), name),
        _sigma(row.get("sigma_target"), name),
        note,
        tuple((column, cell) for column, cell in extra),
    )


def _place(value: Any, name: str) -> Place | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        refuse(f"pair {name!r} has {shown(value)} for a place")
    x, y, z = (float(number) for number in value)
    return x, y, z


def _sigma(value: Any, name: str) -> float | None:
    if value is None:
        return None
    if not _is_number(value) or not SMALLEST_SIGMA <= value <= LARGEST_SIGMA:
        refuse(f"pair {name!r} has {shown(value)} for a sigma")
    return float(value)


def adopted_in(value: Any) -> Adopted | None:
    """Read an adopted similarity."""
    if value is None:
        return None
    rotation, translation = _list(value, "rotation"), _list(value, "translation")
    numbers = [value.get("scale") if isinstance(value, dict) else None, *rotation, *translation]
    sizes = (len(rotation), len(translation))
    if sizes != (9, 3) or not all(map(_is_number, numbers)) or not numbers[0] > 0:
        refuse("its adopted similarity is none")
    numbers = [float(number) for number in numbers]
    adopted = Adopted(numbers[0], tuple(numbers[1:10]), tuple(numbers[10:]))
    if not adopted.similarity.is_proper:
        refuse("the rotation of its adopted similarity is none")
    return adopted


def _list(value: Any, key: str) -> list[Any]:
    found = value.get(key) if isinstance(value, dict) else None
    return found if isinstance(found, list) else []


def _is_number(value: Any) -> bool:
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    # NaN is not below anything either.
    return is_one and abs(value) <= FARTHEST


def typed(document: dict[str, Any], key: str, kind: type) -> Any:
    """Return what stands under a key, of one kind."""
    value = document.get(key)
    if not isinstance(value, kind):
        refuse(f"its '{key}' is missing or of the wrong kind")
    return value


def shown(value: Any) -> str:
    """Quote a value that can't be, in a few words."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def refuse(reason: str) -> NoReturn:
    """Say what is wrong with a document."""
    raise NotSessionError(reason)
