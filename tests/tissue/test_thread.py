"""Thread in tissue: friction along its path, lips pulled together, tearing; with a string of masses and springs."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.material import TissueMaterial

from tests.tissue.strings import String
from tests.tissue.wounds import draw_together, gap_at, gaping_pad, held_stitch


def _block(kit, material):
    block = kit.pad(material, cells=(12, 8, 3))
    y, z = 0.0155, 0.0052
    path = block.lay_path(np.column_stack([np.linspace(0.008, 0.032, 13), np.full(13, y), np.full(13, z)]), 1e-4)
    points = np.column_stack([np.linspace(0.058, -0.002, 31), np.full(31, y), np.full(31, z)])
    thread = block.add_thread(1e-4)
    # The path's exit, x = 0.032, stands at this length from the thread's first point.
    thread.insert(path, 0.058 - 0.032)
    return block, String(block, thread, points)


def test_thread_pulled_along_its_path_feels_friction_for_each_metre(kit):
    material = TissueMaterial(1e5, friction=10.0)
    block, string = _block(kit, material)
    for _ in range(120):
        string.held[0] = string.held.get(0, string.x[0]) + [2e-5, 0.0, 0.0]
        string.tick()
        block.step()
    assert string.pull[0][0] == pytest.approx(10.0 * 0.024, rel=0.02)
    assert string.thread.engaged.sum() == 13


def test_thread_can_be_pulled_out_and_leaves_the_tissue_at_rest(kit):
    block, string = _block(kit, TissueMaterial(1e5, friction=10.0))
    for _ in range(400):
        string.held[0] = string.held.get(0, string.x[0]) + [1.2e-4, 0.0, 0.0]
        string.tick()
        block.step()
    assert string.thread.engaged.sum() == 0
    np.testing.assert_allclose(block.positions, block.elastic.grid.nodes, atol=2e-5)


@pytest.mark.parametrize("strength", [20.0, 40.0])
def test_thread_pulled_across_tears_the_tissue_at_its_strength(kit, strength):
    block, string = _block(kit, TissueMaterial(1e5, strength=strength))
    last = len(string.x) - 1
    expected = strength * 0.024
    # All of the thread is pulled across, as by the bar of a loop.
    string.held = {i: string.x[i].copy() for i in range(last + 1)}
    loads = []
    for _ in range(100):
        for i in string.held:
            string.held[i] = string.held[i] + [0.0, 4e-5, 0.0]
        string.tick()
        block.step()
        loads.append(sum(pull[1] for pull in string.pull.values()))
    assert max(loads) == pytest.approx(expected, rel=0.15)
    assert loads[-1] == pytest.approx(expected, rel=0.15)
    nodes = string.thread.engaged.nonzero()[0]
    material = np.einsum("ik,ika->ia", block.interface.points.weights[nodes],
                         block.elastic.grid.nodes[block.interface.points.nodes[nodes]])  # fmt: skip
    assert (material[:, 1] > 0.0155 + 1e-3).all()


def test_the_first_node_of_a_path_holds_the_thread_before_the_needle_has_left_the_next(kit):
    block, string = _block(kit, TissueMaterial(1e5))
    first, *others = block.paths.node[0, : block.paths.count[0]]
    string.thread.engaged[others] = 0
    before = block.interface.points.weights[first].copy()
    string.held = {i: x.copy() for i, x in enumerate(string.x)}
    for _ in range(100):
        for i in string.held:
            string.held[i] = string.held[i] + [0.0, 5e-6, 0.0]
        string.tick()
        block.step()
    assert 0.05 < sum(pull[1] for pull in string.pull.values()) < 0.5
    np.testing.assert_array_equal(block.interface.points.weights[first], before)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.002, 0.004])
def test_stitches_draw_the_lips_of_a_wound_together_without_overlap(kit, gap):
    block = gaping_pad(gap)
    stitches = (0.0135, 0.0225, 0.0315)
    strings = [held_stitch(block, x, gap) for x in stitches]
    assert block.lips.gaps().min() == pytest.approx(gap)
    for tick in range(180 if gap < 0.003 else 350):
        for string in strings:
            draw_together(string, 4.4e-5 * tick)
            string.tick()
        block.step()
    gaps = block.lips.gaps()
    for x in stitches:
        assert gap_at(block, x) < 1e-4
    assert gaps.min() > -5e-5


def test_thread_follows_the_needle_into_its_path(kit):
    block = kit.pad(TissueMaterial(1e5, friction=10.0))
    tip = np.array([0.021, 0.0155, kit.SIZE[2] + 5e-4])
    needle = kit.SprungNeedle(block, tip, (0.0, 0.0, -1.0), length=0.015)
    thread = block.add_thread(1e-4)
    needle.advance(0.014, 0.1)
    assert needle.needle.depth > 0.008
    points = None
    for _ in range(300):
        needle.goal = needle.goal + [0.0, 0.0, -1e-4]
        needle.tick()
        tail = needle.tip + [0.0, 0.0, 0.015]
        thread.draw_in(needle.needle)
        points = tail + np.outer(np.arange(0.0, 0.06, 0.002), [0.0, 0.0, 1.0])
        while thread.settle(points) is not None if thread.springs(points) is not None else False:
            pass
        block.step()
    assert needle.needle.depth == 0.0
    assert thread.engaged.sum() == block.paths.count[0] > 4
    force = block.interface.points.force[thread.engaged.nonzero()[0]]
    assert -force[:, 2].sum() == pytest.approx(10.0 * block.paths.length[0], rel=0.03)


def test_snapshot_of_a_thread_restores_to_the_bit(kit):
    block, string = _block(kit, TissueMaterial(1e5, friction=10.0))

    def pull(ticks):
        for _ in range(ticks):
            string.held[0] = string.held.get(0, string.x[0]) + [3e-5, 1e-5, 0.0]
            string.tick()
            block.step()

    pull(57)
    kept, x, v, held = block.snapshot(), string.x.copy(), string.v.copy(), string.held[0].copy()
    pull(50)
    expected = [string.x.copy(), block.positions.copy()]
    pull(21)
    block.reset()
    block.restore(kept)
    string.x, string.v, string.held[0] = x, v, held
    pull(50)
    np.testing.assert_array_equal(string.x, expected[0])
    np.testing.assert_array_equal(block.positions, expected[1])


def test_path_outside_the_tissue_is_rejected(kit):
    with pytest.raises(ValueError, match="lies outside the tissue"):
        kit.pad().lay_path(np.array([[0.01, 0.01, 0.005], [0.01, 0.01, 0.015]]), 1e-4)
