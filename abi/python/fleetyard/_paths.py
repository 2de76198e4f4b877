"""Plans on grids: encodings of paths on the wire, and the forms that an author may hand over.

Per agent a list of cells, of ``(row, col)``, an array of either (anything with
``tolist``, as NumPy's arrays), or a string of moves from the agent's start: ``N E S W``
for a step up, right, down, left, ``.`` for a wait, and ``n e s w`` for the diagonal steps
up-right, down-right, down-left, up-left. The whole plan may be one array as well: agents
by time steps, or agents by time steps by 2.
"""

from __future__ import annotations

from typing import Any, Iterable, List, Mapping, Sequence, Set, SupportsIndex, Tuple, Union

from ._maps import MOVES
from ._model import OFF_MAP
from ._numbers import whole

Paths = Iterable[Union[str, Iterable[Union[SupportsIndex, Sequence[SupportsIndex]]]]]
"""The forms of a plan that an author may hand over: one path per agent."""

_MOVES = {".": (0, 0), **MOVES}
_LETTERS = {move: letter for letter, move in _MOVES.items()}


def encode(paths: Any, starts: Sequence[int], rows: int, cols: int) -> List[Any]:
    """The paths as the wire has them: moves where the path is made of moves, so that
    plans are short, and positions otherwise, so that the host sees every fault."""
    paths = _plain(paths, "the plan", 1)
    if isinstance(paths, (str, bytes, Mapping, Set)) or not hasattr(paths, "__iter__"):
        raise TypeError(f"a plan is a list with one path per agent, not {_short(paths)}")
    paths = list(paths)
    if len(paths) != len(starts):
        raise ValueError(
            f"the plan has {len(paths)} paths, but the instance has {len(starts)} agents"
        )
    return [
        _encode_path(agent, path, start, rows, cols)
        for agent, (path, start) in enumerate(zip(paths, starts))
    ]


def _encode_path(agent: int, path: Any, start: int, rows: int, cols: int) -> Any:
    if isinstance(path, str):
        for index, letter in enumerate(path):
            if letter not in _MOVES:
                raise ValueError(
                    f"letter {letter!r} at position {index} of the path of agent {agent} is no move"
                )
        return path
    path = _plain(path, f"the path of agent {agent}", 0)
    if isinstance(path, (bytes, Mapping, Set)) or not hasattr(path, "__iter__"):
        raise TypeError(f"the path of agent {agent} is not a list but {_short(path)}")
    positions = [_position(agent, time, item, cols) for time, item in enumerate(path)]
    on_map = all(0 <= row < rows and 0 <= col < cols for row, col in positions)
    if on_map and positions and positions[0] == divmod(start, cols):
        try:
            return "".join(
                _LETTERS[to_row - row, to_col - col]
                for (row, col), (to_row, to_col) in zip(positions, positions[1:])
            )
        except KeyError:
            pass  # a step that is no move: the host shall see it
    return [list(position) for position in positions]


def _plain(value: Any, what: str, more: int) -> Any:
    """An array as lists, if it can be what it should: cells, or (row, col), with ``more``
    dimensions before them. Anything else as it is."""
    kind = getattr(getattr(value, "dtype", None), "kind", "O")
    if kind not in "iuO":
        raise TypeError(f"{what} is an array of {value.dtype}, but cells are whole numbers")
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and kind != "O":
        cells, pairs = len(shape) == 1 + more, len(shape) == 2 + more and shape[-1] == 2
        if not (cells or pairs):
            wanted = ("agents, steps", "agents, steps, 2") if more else ("steps,", "steps, 2")
            raise TypeError(
                f"{what} is an array of shape {shape}, not ({wanted[0]}) of cells "
                f"or ({wanted[1]}) of rows and columns"
            )
    return getattr(value, "tolist", lambda: value)()


def _position(agent: int, time: int, item: Any, cols: int) -> Tuple[int, int]:
    try:
        if isinstance(item, (tuple, list)):
            row, col = item
            return whole(row), whole(col)
        if hasattr(item, "__len__"):  # a row of an array
            return _position(agent, time, tuple(item), cols)
        return divmod(whole(item), cols)
    except (TypeError, ValueError):
        raise TypeError(
            f"the path of agent {agent} has {_short(item)} at time {time}, "
            "which is neither a cell nor (row, col)"
        ) from None


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def decode(wire: Any, starts: Sequence[int], rows: int, cols: int) -> List[List[int]]:
    """Paths from the host as lists of cells; positions off the map are OFF_MAP."""
    return [_decode_path(path, agent, starts, rows, cols) for agent, path in enumerate(wire)]


def _decode_path(path: Any, agent: int, starts: Sequence[int], rows: int, cols: int) -> List[int]:
    def cell(row: int, col: int) -> int:
        return row * cols + col if 0 <= row < rows and 0 <= col < cols else OFF_MAP

    if isinstance(path, str):
        row, col = divmod(starts[agent], cols)
        cells = [cell(row, col)]
        for letter in path:
            move = _MOVES.get(letter)
            if move is None:
                raise ValueError(f"letter {letter!r} of the path of agent {agent} is no move")
            row, col = row + move[0], col + move[1]
            # Once off the map, always off the map: as the host reads it.
            cells.append(OFF_MAP if cells[-1] == OFF_MAP else cell(row, col))
        return cells
    return [
        cell(*divmod(int(item), cols)) if isinstance(item, int) else cell(*map(int, item))
        for item in path
    ]
