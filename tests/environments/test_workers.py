"""Work that processes share is what one process does, in order, and who ends too soon is named."""

from __future__ import annotations

import itertools
import math
import os
import signal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.environments.workers import WorkerEndedError, results


@settings(max_examples=6)
@given(st.lists(st.integers(-5, 5), max_size=12), st.integers(1, 3))
def test_processes_return_results_in_order_or_the_first_error(numbers: list[int], count: int) -> None:
    """They return what the function returns here, up to the first number that it takes no root of."""
    begun = results(math.sqrt, numbers, count)
    good = list(itertools.takewhile(lambda number: number >= 0, numbers))
    found = []
    try:
        found.extend(begun)
    except ValueError as error:
        assert len(good) < len(numbers) and "domain" in str(error) and "workers.py" in str(error.__cause__)
        assert found == [math.sqrt(number) for number in good[: len(found)]]
    else:
        assert found == [math.sqrt(number) for number in good] and len(good) == len(numbers)


def test_a_process_that_ends_is_named_with_the_reason() -> None:
    with pytest.raises(WorkerEndedError, match=r"process \d+, .*ended with status 3"):
        list(results(os._exit, [3], 1))
    with pytest.raises(WorkerEndedError, match="was ended by SIGKILL"):
        list(results(signal.raise_signal, [9, 9], 2))
