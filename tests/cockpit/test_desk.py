"""One operates: who sits down, who comes back, who must wait."""

from __future__ import annotations

from ligature.cockpit.desk import GRACE, Desk


def test_the_first_to_claim_operates_and_others_wait() -> None:
    desk = Desk()
    assert desk.claim(1, 0.0)
    assert desk.claim(2, 1.0) is None
    assert desk.operator == 1


def test_the_desk_is_kept_for_an_operator_who_reloads() -> None:
    desk = Desk()
    key = desk.claim(1, 0.0)
    assert key is not None
    assert desk.leaves(1, 10.0)
    assert desk.claim(2, 11.0) is None
    assert not desk.comes_back(2, "no such key", 11.0)
    assert desk.comes_back(3, key, 12.0)
    assert desk.operator == 3


def test_after_a_while_anybody_may_sit_down_and_the_old_key_is_worthless() -> None:
    desk = Desk()
    key = desk.claim(1, 0.0)
    assert key is not None
    desk.leaves(1, 10.0)
    assert desk.claim(2, 10.0 + GRACE + 0.1)
    assert not desk.comes_back(3, key, 10.0 + GRACE + 0.2)
    assert desk.claim(3, 11.0 + GRACE, key) is None


def test_another_tab_of_the_operators_browser_takes_over_only_when_asked() -> None:
    desk = Desk()
    key = desk.claim(1, 0.0)
    assert key is not None
    assert not desk.comes_back(2, key, 1.0)
    assert desk.operator == 1
    assert desk.claim(2, 1.0, key)
    assert desk.operator == 2


def test_who_gives_up_the_desk_leaves_it_to_the_next() -> None:
    desk = Desk()
    desk.claim(1, 0.0)
    assert not desk.releases(2)
    assert desk.releases(1)
    assert desk.claim(2, 0.1)


def test_a_viewer_that_leaves_changes_nothing() -> None:
    desk = Desk()
    desk.claim(1, 0.0)
    assert not desk.leaves(2, 1.0)
    assert desk.operator == 1
