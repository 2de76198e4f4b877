"""Numbers and lists of them, from the wire or from an author."""

from __future__ import annotations

import math
import operator
from typing import Any, Callable, Iterable, List, Tuple, TypeVar

from ._failures import InvalidInput

Item = TypeVar("Item")

Point = Tuple[float, float]
"""A place in the plane: x to the right, y upwards."""


def whole(value: Any) -> int:
    """An integer of any kind; no float, and no truth value."""
    if isinstance(value, bool):
        raise TypeError("a truth value is no number")
    return operator.index(value)


def number(value: Any) -> float:
    """A number of any kind, but no text and no truth value."""
    if isinstance(value, (bool, str, bytes)):
        raise TypeError(f"{value!r:.60} is no number")
    return float(value)


def numbers(values: Any) -> List[float]:
    """Numbers of a list from the wire."""
    return [number(value) for value in values]


def point(values: Any) -> Point:
    """A point of the wire, ``[x, y]``."""
    x_m, y_m = values
    return number(x_m), number(y_m)


def listed(values: Any, what: str) -> List[Any]:
    """A list from a list, or from an array that has ``tolist``."""
    values = getattr(values, "tolist", lambda: values)()
    if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
        raise TypeError(f"{what} is no list but {values!r:.60}")
    return list(values)


def places(values: Any, what: str = "the list") -> List[int]:
    """A list of whole numbers from a list, or from an array that has ``tolist``."""
    result = []
    for at, value in enumerate(listed(values, what)):
        try:
            result.append(whole(value))
        except TypeError:
            raise TypeError(f"{what} has {value!r:.60} at place {at}, no whole number") from None
    return result


def lists(values: Any, read: Callable[[Any], Item]) -> List[List[Item]]:
    """A list of lists of the wire."""
    return [[read(value) for value in each] for each in values]


def finite(what: str, values: Iterable[float]) -> None:
    """Fails if one of the numbers is none of the plane."""
    for value in values:
        if not math.isfinite(value):
            raise InvalidInput(f"`{what}` has {value}, which is not finite")


def same_length(what: str, found: int, expected: int) -> None:
    """Fails if a list has another length than it must."""
    if found != expected:
        raise InvalidInput(f"`{what}` has {found} entries, not {expected}")
