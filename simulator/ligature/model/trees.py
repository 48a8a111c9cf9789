"""Kinematic structure: command vectors, spanning trees, loops, and pairs that do not collide."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from ligature.model.axes import axes_of
from ligature.model.scene import Articulation, Body, Joint, JointType, Link

TREE_TYPES = tuple(kind for kind in JointType if kind is not JointType.P2P)
"""Joints that a tree can hold, as one link per free axis."""

MOST_LINKS = 120
"""Links of a tree, those at the ends of closing joints included; Bullet fails with 128."""

MAX_LINKS = 112
"""Links of the joints that a tree holds; the others are for closing joints."""

LIGHT = 0.5
"""Mass of a body over that of the heaviest one of its tree up to which that one is the root instead."""


@dataclass
class _Below:
    """Descendants of a body, (child body, joint) in the order of AMBF's joint commands, and its ancestors."""

    pairs: list[tuple[int, int]] = field(default_factory=list)
    children: set[int] = field(default_factory=set)
    ancestors: dict[int, None] = field(default_factory=dict)

    def add(self, pairs: Iterable[tuple[int, int]]) -> None:
        for child, joint in pairs:
            if child not in self.children:
                self.children.add(child)
                self.pairs.append((child, joint))


def command_vectors(n_bodies: int, joints: Sequence[Joint]) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """For every body the active joints below it and their child bodies, in command order."""
    below = [_Below() for _ in range(n_bodies)]
    for joint in joints:
        if joint.parent == joint.child:
            continue
        pairs = [*below[joint.child].pairs, (joint.child, joint.index)]
        if len(pairs) > 1:
            pairs = [pairs[-1], *pairs[:-1]]
        parent = below[joint.parent]
        for body in (joint.parent, *parent.ancestors):
            if body != joint.child:
                below[body].add(pairs)
        heirs = (joint.child, *(child for child, _ in below[joint.child].pairs))
        for heir in heirs:
            below[heir].ancestors.update({above: None for above in (joint.parent, *parent.ancestors) if above != heir})
    result = []
    for entry in below:
        active = [(child, joint) for child, joint in entry.pairs if not joints[joint].passive]
        result.append((tuple(j for _, j in active), tuple(c for c, _ in active)))
    return result


def articulations(
    bodies: Sequence[Body], joints: Sequence[Joint], rod_bodies: frozenset[int], rod_joints: frozenset[int]
) -> tuple[tuple[Articulation, ...], tuple[int, ...]]:
    """Spanning trees over all bodies outside rods, and the joints that no tree holds.

    A static body is always the root of its tree, so that forces never move it.
    """
    edges: dict[int, list[Joint]] = {}
    for joint in joints:
        if joint.type in TREE_TYPES and not {joint.parent, joint.child} & rod_bodies and joint.parent != joint.child:
            edges.setdefault(joint.parent, []).append(joint)
            edges.setdefault(joint.child, []).append(joint)
    with_parent = {joint.child for joint in joints if joint.type in TREE_TYPES}
    free = [b for b in bodies if b.index not in rod_bodies]
    order = sorted(free, key=lambda b: (not b.static, b.index in with_parent, b.index))
    placed: set[int] = set()
    used: set[int] = set()
    trees = []
    for root in order:
        if root.index not in placed:
            trees.append(_tree(_root(root.index, bodies, edges, placed), bodies, edges, placed, used))
    trees.sort(key=lambda tree: min(link.body for link in tree.links))
    loops = [j.index for j in joints if j.index not in used and j.index not in rod_joints]
    return tuple(trees), tuple(loops)


def _root(first: int, bodies: Sequence[Body], edges: dict[int, list[Joint]], placed: set[int]) -> int:
    """The root of the tree that ``first`` is in: itself, or the heaviest body where it is no more than `LIGHT` of that.

    A heavy body that hangs on a light one moves by coordinates that are large and nearly cancel.
    """
    if bodies[first].static:
        return first
    found, seen = [first], {first, *placed}
    for body in found:
        for joint in edges.get(body, ()):
            other = joint.child if joint.parent == body else joint.parent
            if other not in seen and not bodies[other].static:
                seen.add(other)
                found.append(other)
    heaviest = max(found, key=lambda body: (bodies[body].mass, -body))
    return first if bodies[first].mass > LIGHT * bodies[heaviest].mass else heaviest


def _tree(
    root: int, bodies: Sequence[Body], edges: dict[int, list[Joint]], placed: set[int], used: set[int]
) -> Articulation:
    links = [Link(root, None, -1)]
    placed.add(root)
    position = count = 0
    while position < len(links):
        body = links[position].body
        for joint in edges.get(body, ()):
            other = joint.child if joint.parent == body else joint.parent
            if other in placed or bodies[other].static or count + links_of(joint) > MAX_LINKS:
                continue
            count += links_of(joint)
            placed.add(other)
            used.add(joint.index)
            links.append(Link(other, joint.index, position))
        position += 1
    return Articulation(tuple(links))


def links_of(joint: Joint) -> int:
    """Links that a joint takes in a tree, the body that it carries included: one for each free axis."""
    return max(1, len(axes_of(joint) or ()))


def silent_pairs(
    n_bodies: int,
    linked: Iterable[tuple[int, int]],
    files: Iterable[Sequence[int]],
    groups: Sequence[tuple[int, ...]],
) -> list[frozenset[int]]:
    """For every body those it does not collide with.

    ``linked`` are pairs of jointed bodies, ``files`` the bodies of files without inter-collision,
    ``groups`` the collision groups of each body.
    """
    silent: list[set[int]] = [set() for _ in range(n_bodies)]
    for a, b in linked:
        silent[a].add(b)
        silent[b].add(a)
    for members in files:
        for a in members:
            silent[a].update(b for b in members if b != a)
    grouped = [(i, set(g)) for i, g in enumerate(groups) if g]
    for i, mine in grouped:
        silent[i].update(j for j, theirs in grouped if j != i and not mine & theirs)
    return [frozenset(s) for s in silent]


def connected(
    bodies: Sequence[Body],
    joints: Sequence[Joint],
    linked: Iterable[tuple[int, int]],
    files: Iterable[Sequence[int]],
    groups: Sequence[tuple[int, ...]],
) -> tuple[Body, ...]:
    """The bodies with the joints and bodies that they command, and those that they do not collide with."""
    vectors = command_vectors(len(bodies), joints)
    silent = silent_pairs(len(bodies), linked, files, groups)
    return tuple(
        replace(body, joints=commanded, children=children, no_collision_with=silent[body.index])
        for body, (commanded, children) in zip(bodies, vectors, strict=True)
    )
