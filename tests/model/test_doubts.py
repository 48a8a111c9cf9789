"""Tissue that can be simulated but is doubtful is reported: where, with the figure, and what would be right."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import ligature
import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import span
from ligature.model.doubts import CONTRADICTION, ENDLESS, LARGEST, SOFTEST
from ligature.model.frames import rpy_matrix
from ligature.model.scene import Scene

SIZE = (0.04, 0.03, 0.02)
BOX = "shape: BOX, geometry: {x: 0.04, y: 0.03, z: 0.02}"


def load(folder: Path, keys: str, tissue: str = "material: silicone pad") -> Scene:
    text = f"bodies: [BODY Pad]\nBODY Pad: {{name: Pad, {keys}, ligature tissue: {{{tissue}}}}}\n"
    (folder / "m.yaml").write_text(text)
    return ligature.load(folder / "m.yaml")


def named(names: str, values: Iterable[float]) -> str:
    """Numbers as a block of a file, such as ``{x: 1.0, y: 2.0}``."""
    return f"{{{', '.join(f'{name}: {float(value)!r}' for name, value in zip(names, values, strict=True))}}}"


def warnings(scene: Scene) -> list[Diagnostic]:
    found = [d for d in scene.diagnostics if d.severity >= Severity.WARNING]
    assert all(d.mark is not None and d.hint for d in found), found
    return found


def one(scene: Scene, words: str) -> bool:
    """Whether the scene's one warning has these words; one without them is none."""
    found = warnings(scene)
    assert len(found) <= 1 and all(words in d.message for d in found), found
    return bool(found)


def test_a_plain_pad_is_not_doubted(tmp_path: Path) -> None:
    for keys, tissue in (
        (f"mass: 0, {BOX}", "material: liver"),
        (BOX, "material: liver, fixed: []"),
        (f"mass: 0.02, {BOX}", "youngs modulus: 1.0e+5, fixed: []"),
        (f"mass: 0, {BOX}", "layers: [{thickness: 0.005, material: skin}, {youngs modulus: 1.0e+4}]"),
        (f"mass: 0, {BOX}", "material: fat, slits: [{from: {x: -1, y: 0, z: 0}, to: {x: 1, y: 0, z: 0.01}}]"),
    ):
        assert not warnings(load(tmp_path, keys, tissue)), tissue


@settings(max_examples=40)
@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.floats(0.05, 20.0), st.floats(100.0, 5000.0), st.floats(0.02, 0.2),
    st.sampled_from(["mass: 0, ", "mass: 1, ", ""]),
)  # fmt: skip
def test_tissue_too_soft_for_its_weight_is_reported(
    tmp_path_factory: pytest.TempPathFactory,
    turn: tuple[float, ...],
    share: float,
    density: float,
    edge: float,
    mass: str,
) -> None:
    """The height is that along gravity of the body as it is placed."""
    size = np.array([1.0, 0.7, 0.4]) * edge
    height = float(np.abs(rpy_matrix(*turn)[2]) @ size)
    young = density * 9.8 * height / (share * SOFTEST)
    assume(young > 1.0 and abs(share - 1.0) > 0.01)
    place = f"location: {{orientation: {named('rpy', turn)}, position: {{x: 0, y: 0, z: 0}}}}"
    shape = f"shape: BOX, geometry: {named('xyz', size)}"
    tissue = f"youngs modulus: {young!r}, density: {density!r}"
    scene = load(tmp_path_factory.mktemp("m"), f"{mass}{shape}, {place}", tissue)
    assert one(scene, f"ρ g h / E is {share * SOFTEST:.2g}") is (share > 1.0)


def test_a_stated_mass_presses_free_tissue_too(tmp_path: Path) -> None:
    found = warnings(load(tmp_path, f"mass: 5, {BOX}", "material: liver, fixed: []"))
    assert ["too soft for its weight" in found[0].message, "has a mass of 5 kg" in found[1].message] == [True, True]


@settings(max_examples=25)
@given(st.floats(0.05, 20.0), st.booleans(), st.booleans())
def test_a_mass_that_contradicts_the_density_is_reported(
    tmp_path_factory: pytest.TempPathFactory, share: float, held: bool, stated: bool
) -> None:
    assume(all(abs(share / limit - 1.0) > 0.01 for limit in (CONTRADICTION, 1.0 / CONTRADICTION)))
    mass = share * 1000.0 * float(np.prod(SIZE))
    tissue = f"youngs modulus: 1.0e+7{', density: 1000' * stated}, fixed: [{'-z' * held}]"
    scene = load(tmp_path_factory.mktemp("m"), f"mass: {mass!r}, {BOX}", tissue)
    beyond = not 1.0 / CONTRADICTION <= share <= CONTRADICTION
    assert one(scene, "density times volume is 0.024 kg") is (beyond and stated and not held)


@settings(max_examples=40)
@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3), st.tuples(*[st.floats(0.001, 0.02)] * 3), st.integers(0, 5))
def test_a_slit_that_cuts_nothing_is_reported(
    tmp_path_factory: pytest.TempPathFactory, low: tuple[float, ...], size: tuple[float, ...], far: int
) -> None:
    """Boxes beside the body, within it, and across its sides; and one that is far longer than the body."""
    begin, end = np.array(low), np.array(low) + size
    half = 0.5 * np.array(SIZE)
    outside = bool(((end <= -half) | (begin >= half)).any())
    if far < 3:
        end[far] += 1.01 * ENDLESS * SIZE[far]
        outside = bool(((end <= -half) | (begin >= half)).any())
    tissue = f"material: silicone pad, slits: [{{from: {named('xyz', begin)}, to: {named('xyz', end)}}}]"
    scene = load(tmp_path_factory.mktemp("m"), f"mass: 0, {BOX}", tissue)
    if any(d.severity >= Severity.ERROR for d in scene.diagnostics):  # it leaves loose pieces, or none
        return
    assert one(scene, f"slit 1 {span(begin, end)}, {'outside' if outside else 'far'}") is (outside or far < 3)


@settings(max_examples=25)
@given(st.lists(st.floats(0.002, 0.03), min_size=1, max_size=4))
def test_layers_of_which_nothing_exists_are_reported(
    tmp_path_factory: pytest.TempPathFactory, thick: list[float]
) -> None:
    depths = np.cumsum(thick)
    assume((np.abs(depths - SIZE[2]) > 1e-4).all())
    layers = ", ".join(f"{{thickness: {t!r}}}" for t in thick) + ", {material: fat}"
    scene = load(tmp_path_factory.mktemp("m"), f"mass: 0, {BOX}", f"material: liver, layers: [{layers}]")
    found = warnings(scene)
    missing = [number + 2 for number, depth in enumerate(depths.tolist()) if depth > SIZE[2]]
    assert [d.message.split(":")[0] for d in found] == [f"body 'BODY Pad' has no cell of layer {n}" for n in missing]


@pytest.mark.parametrize(("scale", "reported"), [(0.9, False), (1.1, True)])
def test_tissue_longer_than_a_person_is_reported(tmp_path: Path, scale: float, reported: bool) -> None:
    trimesh.creation.box((0.5 * LARGEST, LARGEST, LARGEST)).export(tmp_path / "pad.obj")
    scene = load(tmp_path, f"mass: 0, mesh: pad.obj, scale: {scale}", "youngs modulus: 1.0e+9")
    assert one(scene, "is tissue 2.2 m long") is reported
    (finding,) = [d for d in scene.diagnostics if "is soft tissue" in d.message]
    assert finding.message.split(", ")[1].endswith(" m") and "e+" not in finding.message.split(", ")[1]


@pytest.mark.parametrize(
    ("mass", "tissue", "words"),
    [
        ("mass: 0, ", "material: liver, fixed: []", "hovers where it is: its 'mass' is 0"),
        ("", "material: liver, fixed: [], carried by: BODY Tray", "but none of its faces is fixed"),
    ],
)
def test_a_hold_that_holds_nothing_is_reported(tmp_path: Path, mass: str, tissue: str, words: str) -> None:
    load(tmp_path, f"{mass}{BOX}", tissue)
    text = (tmp_path / "m.yaml").read_text().replace("[BODY Pad]", "[BODY Pad, BODY Tray]")
    (tmp_path / "m.yaml").write_text(f"{text}BODY Tray: {{name: Tray, mass: 1}}\n")
    assert one(ligature.load(tmp_path / "m.yaml"), words)


def test_tissue_without_a_carrier_is_simulated_and_is_reported_as_that(tmp_path: Path) -> None:
    scene = load(tmp_path, f"mass: 0.1, {BOX}", "material: liver, carried by: BODY Nobody")
    (finding,) = warnings(scene)
    assert len(scene.tissues) == 1 and "is carried by nothing" in finding.message and "left out" not in str(finding)
    text = (tmp_path / "m.yaml").read_text().replace("[BODY Pad]", "[BODY Pad, BODY Nobody]")
    (tmp_path / "m.yaml").write_text(f"{text}BODY Nobody: {{name: Nobody, mass: 1, mesh: none.obj}}\n")
    scene = ligature.load(tmp_path / "m.yaml")
    (finding,) = warnings(scene)
    assert len(scene.tissues) == 1
    assert "left out with it: 'ligature tissue.carried by' of 'BODY Pad'" in finding.hint
