"""Pairs the items of a list with those it is to have, so that each is changed where it stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

GAP = 70
"""Cost of an item that goes or is new; an item that is changed costs at most 100, and so less than both."""

Pair = tuple[int | None, int | None]


def aligned(
    old: Sequence[Mapping[str, Any]], new: Sequence[Mapping[str, Any]], same: Callable[[Any, Any], bool]
) -> list[Pair]:
    """Indices of the items that belong together, in order; None for what is new, or goes.

    Of all ways to pair them in order it is the one that changes the fewest keys (Needleman and Wunsch 1970). Items
    that are the same at both ends are paired first.
    """
    start = 0
    while start < min(len(old), len(new)) and same(dict(old[start]), dict(new[start])):
        start += 1
    end = 0
    while end < min(len(old), len(new)) - start and same(dict(old[-1 - end]), dict(new[-1 - end])):
        end += 1
    middle = _aligned(old[start : len(old) - end], new[start : len(new) - end], same)
    pairs: list[Pair] = [(i, i) for i in range(start)]
    pairs += [(None if i is None else i + start, None if j is None else j + start) for i, j in middle]
    return pairs + [(len(old) - k, len(new) - k) for k in range(end, 0, -1)]


def _aligned(
    old: Sequence[Mapping[str, Any]], new: Sequence[Mapping[str, Any]], same: Callable[[Any, Any], bool]
) -> list[Pair]:
    cost = [[_difference(a, b, same) for b in new] for a in old]
    best = [[GAP * (i + j) for j in range(len(new) + 1)] for i in range(len(old) + 1)]
    for i in range(1, len(old) + 1):
        for j in range(1, len(new) + 1):
            paired = best[i - 1][j - 1] + cost[i - 1][j - 1]
            best[i][j] = min(paired, best[i - 1][j] + GAP, best[i][j - 1] + GAP)
    pairs: list[Pair] = []
    i, j = len(old), len(new)
    while i or j:
        if i and j and best[i][j] == best[i - 1][j - 1] + cost[i - 1][j - 1]:
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif i and best[i][j] == best[i - 1][j] + GAP:
            i -= 1
            pairs.append((i, None))
        else:
            j -= 1
            pairs.append((None, j))
    return pairs[::-1]


def _difference(a: Mapping[str, Any], b: Mapping[str, Any], same: Callable[[Any, Any], bool]) -> int:
    """0 for equal items, up to 100 for such as have nothing in common."""
    keys = a.keys() | b.keys()
    differing = sum(not (key in a and key in b and same(a[key], b[key])) for key in keys)
    return 20 + 80 * differing // len(keys) if differing else 0
