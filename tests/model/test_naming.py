"""Namespaces and topic names."""

from __future__ import annotations

import pytest
from ligature.model.naming import merged, topic_name


@pytest.mark.parametrize(
    ("outer", "inner", "result"),
    [
        ("/a/b", "c/", "/a/bc/"),
        ("/a/b/", "c/", "/a/b/c/"),
        ("/a//b/", "/c", "/c"),
        ("/a/", "", "/a/"),
        ("/ambf/env/ecm/", "ambf/env/psm/", "/ambf/env/ecm/ambf/env/psm/"),
    ],
)
def test_an_inner_namespace_is_appended_unless_absolute(outer: str, inner: str, result: str) -> None:
    assert merged(outer, inner) == result


def test_repeated_slashes_collapse_in_topics() -> None:
    assert topic_name("/ambf/env/psm1/", "tool_id/400006") == "/ambf/env/psm1/tool_id/400006"
    assert topic_name("", "Needle") == "/Needle"
