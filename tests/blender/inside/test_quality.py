"""Figures of how collision shapes stand for a mesh, against geometry done by hand, and what is drawn of them."""

import bpy
import numpy as np
import pytest
from adf_studio import making, quality, quality_overlay
from adf_studio.ligature.authoring.shapes import Shape
from adf_studio.mesh_making import shape_data

from .scene import body, model, select

ELL = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2))])
SIDES = [(0, 5, 4, 3, 2, 1), (6, 7, 8, 9, 10, 11), *((i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6))]
LOWER, UPPER = ELL[[0, 1, 2, 6, 7, 8]], ELL[[3, 4, 5, 9, 10, 11]]
BOXES = [np.vstack([LOWER, [(0, 1, 0), (0, 1, 1)]]), np.vstack([UPPER, [(0, 1, 0), (0, 1, 1)]])]


def ell():
    """A body in the shape of an L, one metre thick, with an edge of two metres."""
    model()
    part = body("ell", location=(5.0, 0.0, 0.0))
    part.rotation_euler = (0.3, 0.2, 0.1)  # figures are the same wherever a body stands
    part.data = shape_data(ELL, SIDES, "ell")
    part.adf.body.collision_mesh_type = "CONVEX_HULL"
    bpy.context.view_layer.update()
    return part


@pytest.mark.parametrize(
    ("pieces", "volume", "distance"),
    [(BOXES, 0.0, 0.0), ([ELL], 0.5 / 3.0, 0.5), (BOXES[:1], -1.0 / 3.0, 1.0), ([BOXES[0] * [1.1, 1, 1], BOXES[1]], 0.2 / 3.0, 0.2)],
    ids=["exact", "over the notch", "one missing", "one too large"],
)  # fmt: skip
def test_figures_of_convex_pieces_are_those_of_the_command_line(pieces, volume, distance):
    part = ell()
    for piece in pieces:
        making.add_hull(part, piece)
    found = quality.measure(part)
    assert found.pieces == len(pieces)
    assert found.volume == pytest.approx(volume, abs=1e-5)
    assert found.distance == pytest.approx(distance, abs=0.01)
    assert quality.kept_figures(part) == pytest.approx(found, abs=1e-6)


def test_primitives_are_measured_with_their_exact_volume_and_the_colours_report_which_side_errs():
    model()
    part = body("block")  # a cube of one metre
    making.add_shape(part, Shape("BOX", size=(1.2, 1.2, 1.0)))
    found = quality.measure(part)
    assert found == pytest.approx((1, 0.44, 0.1 * np.sqrt(2.0)), abs=0.01)
    corners, deviation = quality.deviations_of(part)
    side = (np.abs(np.abs(corners[..., 0]) - 0.5) < 1e-6) & (np.abs(corners[..., 1:]) < 0.3).all(axis=-1)
    np.testing.assert_allclose(deviation[side], -0.1, atol=1e-6)
    making.add_shape(part, Shape("SPHERE", radius=0.5))
    part.children[0].adf.export = False
    found = quality.measure(part)
    assert found.volume == pytest.approx(np.pi / 6.0 - 1.0, abs=1e-5)  # not of the sphere's triangles
    corners, deviation = quality.deviations_of(part)
    corner = (np.abs(np.abs(corners) - 0.5) < 1e-6).all(axis=-1)
    assert corner.sum() >= 8
    np.testing.assert_allclose(deviation[corner], 0.5 * (np.sqrt(3.0) - 1.0), atol=0.01)
    red, green, blue, _ = quality_overlay.colours_of(deviation[corner], found.distance)[0]
    assert red > 0.9 and green < 0.2 and blue < 0.2


def test_a_concave_collision_mesh_is_measured_as_it_is():
    part = ell()
    making.add_hull(part, ELL)
    part.children[0].data = part.data
    part.adf.body.collision_mesh_type = "CONCAVE_MESH"
    assert quality.measure(part) == pytest.approx((1, 0.0, 0.0), abs=1e-5)


def test_the_operator_reports_the_figures_and_what_is_written_states_when_they_are_old():
    part = ell()
    making.add_hull(part, ELL)
    select(part)
    before = bpy.context.scene.adf.show_quality
    assert bpy.ops.adf.measure_collision() == {"FINISHED"}
    words = quality_overlay.words_of(part)
    assert words[:3] == ["ell", "1 piece", "volume +16.7 %"]
    assert words[3].startswith("Hausdorff distance 50") or words[3].startswith("Hausdorff distance 49")
    assert len(words) == 4 and before
    part.location.x += 1.0  # elsewhere it is the same body
    bpy.context.view_layer.update()
    assert len(quality_overlay.words_of(part)) == 4
    part.children[0].scale.x = 1.5
    bpy.context.view_layer.update()
    assert quality_overlay.words_of(part)[4] == "changed since; measure again"
    part.children[0].scale.x = 1.0
    part.modifiers.new("bevel", "BEVEL")
    bpy.context.view_layer.update()
    assert len(quality_overlay.words_of(part)) == 5


def test_a_body_that_cannot_be_measured_is_reported_why():
    model()
    part = body("bare")
    select(part)
    with pytest.raises(RuntimeError, match="'bare': it has no collision shape; add or fit a primitive"):
        bpy.ops.adf.measure_collision()
    making.add_shape(part, Shape("PLANE"))
    with pytest.raises(RuntimeError, match="'bare': a plane is infinite"):
        bpy.ops.adf.measure_collision()
    assert not part.adf.quality.measured
