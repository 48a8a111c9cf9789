"""Trees over any bodies and joints: each body once, fixed ones only as roots, and commands from the base to the tips."""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.scene import Body, Identity, Joint, JointType
from ligature.model.trees import MAX_LINKS, articulations, command_vectors, links_of, silent_pairs

IDENTITY = Identity("x", "x", "x", "x", 0)
MOST = 6
TYPES = (JointType.REVOLUTE, JointType.FIXED, JointType.P2P)
BODIES = st.lists(st.booleans(), min_size=1, max_size=MOST)
"""Whether each body is static."""

PAIRS = st.lists(
    st.tuples(st.integers(0, MOST - 1), st.integers(0, MOST - 1), st.sampled_from(TYPES), st.booleans()), max_size=8
)
"""Parent, child (modulo the number of bodies), type and passivity of each joint."""

Drawn = Sequence[tuple[int, int, JointType, bool]]


def body(index: int, static: bool) -> Body:
    return Body(index, IDENTITY, 0.0 if static else 1.0, np.ones(3), np.eye(4), np.eye(4), np.zeros(3))


def joints_of(drawn: Drawn, count: int) -> list[Joint]:
    return [
        Joint(k, IDENTITY, kind, a % count, b % count, np.array([0.0, 0.0, 1.0]), np.eye(4), np.eye(4), np.eye(4), passive=passive)
        for k, (a, b, kind, passive) in enumerate(drawn)
    ]  # fmt: skip


@given(BODIES, PAIRS, st.sets(st.integers(0, MOST - 1), max_size=2))
def test_trees_span_all_bodies_outside_rods_once(statics: list[bool], drawn: Drawn, inner: set[int]) -> None:
    bodies, joints = [body(k, static) for k, static in enumerate(statics)], joints_of(drawn, len(statics))
    rods = frozenset(k for k in inner if k < len(bodies))
    of_rods = frozenset(j.index for j in joints if {j.parent, j.child} <= rods)
    trees, loops = articulations(bodies, joints, rods, of_rods)
    links = [link for tree in trees for link in tree.links]
    assert sorted(link.body for link in links) == [k for k in range(len(bodies)) if k not in rods]
    held = [link.joint for link in links if link.joint is not None]
    assert sorted([*held, *loops, *of_rods]) == list(range(len(joints)))
    assert [min(link.body for link in tree.links) for tree in trees] == sorted(
        min(k.body for k in t.links) for t in trees
    )
    for tree in trees:
        assert tree.links[0].joint is None
        for place, link in enumerate(tree.links[1:], 1):
            assert link.joint is not None and link.parent_link < place and not bodies[link.body].static
            ends = {joints[link.joint].parent, joints[link.joint].child}
            assert (
                ends == {link.body, tree.links[link.parent_link].body} and joints[link.joint].type is not JointType.P2P
            )
    tree_of = {link.body: k for k, tree in enumerate(trees) for link in tree.links}
    for index in loops:  # it closes a loop, joins two fixed bodies, holds a point, or belongs to a rod
        a, b = joints[index].parent, joints[index].child
        if joints[index].type is not JointType.P2P and not {a, b} & rods and tree_of[a] != tree_of[b]:
            assert statics[trees[tree_of[a]].links[0].body] and statics[trees[tree_of[b]].links[0].body]


@given(st.integers(2, MOST), st.randoms(use_true_random=False), st.lists(st.booleans(), min_size=MOST, max_size=MOST))
def test_a_body_commands_the_active_joints_below_it(count: int, rng: random.Random, passive: list[bool]) -> None:
    above = {child: rng.randrange(child) for child in range(1, count)}
    order = rng.sample(sorted(above), len(above))
    joints = joints_of([(above[child], child, JointType.REVOLUTE, passive[child]) for child in order], count)
    for index, (commanded, children) in enumerate(command_vectors(count, joints)):
        below = {index}
        for child in range(index + 1, count):
            if above[child] in below:
                below.add(child)
        assert sorted(children) == sorted(child for child in below - {index} if not passive[child])
        assert [joints[joint].child for joint in commanded] == list(children)


@given(PAIRS)
def test_a_body_commands_each_other_one_by_one_joint_at_most(drawn: Drawn) -> None:
    joints = joints_of(drawn, MOST)
    for commanded, children in command_vectors(MOST, joints):
        assert len(set(children)) == len(children) == len(set(commanded)) == len(commanded)
        assert [joints[joint].child for joint in commanded] == list(children)


@pytest.mark.parametrize("looped", [False, True])
def test_a_chain_is_commanded_from_base_to_tip(looped: bool) -> None:
    chain = [(k, k + 1, JointType.REVOLUTE, False) for k in range(MOST - 1)]
    more = [(MOST - 1, 0, JointType.REVOLUTE, False), (2, 2, JointType.REVOLUTE, False)] if looped else []
    for index, (_, children) in enumerate(command_vectors(MOST, joints_of([*chain, *more], MOST))):
        assert children[: MOST - 1 - index] == tuple(range(index + 1, MOST))


@pytest.mark.parametrize("beyond", [0, 1, 5])
def test_a_tree_holds_only_so_many_links(beyond: int) -> None:
    count = MAX_LINKS + 1 + beyond
    bodies = [body(k, False) for k in range(count)]
    trees, loops = articulations(
        bodies, joints_of([(0, k, JointType.REVOLUTE, False) for k in range(1, count)], count), frozenset(), frozenset()
    )
    assert [len(tree.links) for tree in trees] == [MAX_LINKS + 1, *[1] * beyond]
    assert len(loops) == beyond


@pytest.mark.parametrize("kind", TYPES)
def test_a_joint_takes_a_link_even_without_an_axis(kind: JointType) -> None:
    assert links_of(joints_of([(0, 1, kind, False)], 2)[0]) == 1


INDICES = st.integers(0, MOST - 1)


@given(
    st.lists(st.tuples(INDICES, INDICES).filter(lambda pair: pair[0] != pair[1]), max_size=4),
    st.lists(st.lists(INDICES, unique=True), max_size=2),
    st.lists(st.lists(st.integers(0, 2), max_size=3).map(tuple), min_size=MOST, max_size=MOST),
)
def test_pairs_are_silent_by_joint_file_or_groups_and_nothing_else(
    linked: list[tuple[int, int]], files: list[list[int]], groups: list[tuple[int, ...]]
) -> None:
    silent = silent_pairs(MOST, linked, files, groups)
    for a in range(MOST):
        for b in range(MOST):
            joined = (a, b) in linked or (b, a) in linked or any({a, b} <= set(members) for members in files)
            apart = bool(groups[a] and groups[b] and not set(groups[a]) & set(groups[b]))
            assert (b in silent[a]) is (a != b and (joined or apart))
