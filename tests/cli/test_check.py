"""`ligature check`: one finding for a cause, none for what has no effect, of the chosen models only."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Diagnostic, Severity
from ligature.cli.check import findings
from ligature.cli.main import app
from PIL import Image
from typer.testing import CliRunner

TRIANGLE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
AXES = {"parent axis": {"x": 0, "y": 0, "z": 1}, "child axis": {"x": 0, "y": 0, "z": 1},
        "parent pivot": {"x": 0, "y": 0, "z": 0}, "child pivot": {"x": 0, "y": 0, "z": 0}}  # fmt: skip
FLAWS = {
    "mesh": {"mesh": "missing.obj"},
    "mass": {"mass": "heavy"},
    "shape": {"collision shape": "SPHERE", "collision geometry": {"radius": -1}},
}


def errors(found: list[Diagnostic]) -> list[str]:
    return [d.message for d in found if d.severity >= Severity.ERROR]


@given(
    st.lists(st.sampled_from([None, None, *FLAWS]), min_size=2, max_size=6).filter(lambda flaws: None in flaws),
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=8),
)
def test_errors_are_as_many_as_bodies_with_a_flaw_and_name_all_that_goes_with_them(
    flaws: list[str | None], pairs: list[tuple[int, int]]
) -> None:
    bodies = [f"BODY {chr(97 + i)}" for i in range(len(flaws))]
    pairs = [(a, b) for a, b in pairs if a != b and max(a, b) < len(bodies)]
    joints = [f"JOINT {i}" for i in range(len(pairs))]
    sensors = [f"SENSOR {body[-1]}" for body in bodies]
    model = {"namespace": "/t/", "bodies": bodies, "joints": joints, "sensors": sensors}
    for body, flaw in zip(bodies, flaws, strict=True):
        model[body] = {"name": body, "mass": 1, **(FLAWS[flaw] if flaw else {})}
    for joint, (a, b) in zip(joints, pairs, strict=True):
        model[joint] = {"name": joint, "type": "revolute", "parent": bodies[a], "child": bodies[b], **AXES}
    for sensor, body in zip(sensors, bodies, strict=True):
        model[sensor] = {"name": sensor, "type": "CONTACT", "parent": body, "range": 0.1}
    with TemporaryDirectory() as place:
        file = Path(place, "m.yaml")
        file.write_text(yaml.safe_dump(model, sort_keys=False))
        found = findings(file, [], False)
    assert len(errors(found)) == sum(flaw is not None for flaw in flaws), errors(found)
    lost = {body for body, flaw in zip(bodies, flaws, strict=True) if flaw}
    hints = " ".join(d.hint for d in found if d.severity >= Severity.ERROR)
    for joint, (a, b) in zip(joints, pairs, strict=True):
        if {bodies[a], bodies[b]} & lost and len(pairs) + 1 <= 5:
            assert f"joint '{joint}'" in hints
    for sensor, body in zip(sensors, bodies, strict=True):
        if body in lost and len(pairs) + 1 <= 5:
            assert f"sensor '{sensor}'" in hints


def test_a_reference_to_a_body_that_no_file_has_is_an_error_still(tmp_path: Path) -> None:
    joint = {"name": "j", "type": "revolute", "parent": "BODY lost", "child": "BODY gone", **AXES}
    model = {"bodies": ["BODY a"], "BODY a": {"name": "a", "mass": 1}, "joints": ["JOINT j"], "JOINT j": joint}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(model, sort_keys=False))
    assert any(
        "its parent 'BODY lost' does not exist" in text for text in errors(findings(tmp_path / "m.yaml", [], False))
    )


@pytest.mark.parametrize("looks", ["map_Kd nowhere.png", "map_Kd /elsewhere/x.png", "Kd red", "map_Bump n.png", "Ns x"])
def test_the_looks_of_a_mesh_that_only_collides_are_not_reported(tmp_path: Path, looks: str) -> None:
    (tmp_path / "m.obj").write_text(TRIANGLE)
    (tmp_path / "m.mtl").write_text(f"newmtl a\n{looks}\n")
    model = {"bodies": ["BODY a"], "BODY a": {"name": "a", "mass": 1, "collision mesh": "m.obj"}}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(model, sort_keys=False))
    assert [d for d in findings(tmp_path / "m.yaml", [], False) if d.severity >= Severity.WARNING] == []
    (tmp_path / "m.mtl").unlink()  # that decides which triangles make a hull
    assert "material library" in str(findings(tmp_path / "m.yaml", [], False))


@pytest.mark.usefixtures("hulls")
def test_no_finding_of_the_corpus_is_about_the_looks_of_what_is_not_drawn(corpus: Path) -> None:
    for launch in ("suturing_scene/launch.yaml", "multibodies/descriptions/launch.yaml"):
        found = findings(corpus / launch, [corpus], False)
        assert not [d for d in found if d.mark and d.mark.file.suffix.lower() == ".mtl"]
        assert not [d for d in found if "parallel_structure" in str(d.mark) and "is left out" in d.message]


def test_check_takes_the_models_that_run_takes(tmp_path: Path) -> None:
    good = "bodies: [BODY a]\nBODY a: {name: a, mass: 1}\n"
    (tmp_path / "good.yaml").write_text(good)
    (tmp_path / "bad.yaml").write_text(good.replace("mass: 1", "mass: heavy"))
    (tmp_path / "world.yaml").write_text("enclosure size: {length: 1, width: 1, height: 1}\n")
    configs = "world config: world.yaml\ninput devices config: devices.yaml\ncolor config: colors.yaml\n"
    (tmp_path / "devices.yaml").write_text("input devices: []\n")
    (tmp_path / "colors.yaml").write_text("red: {r: 255, g: 0, b: 0, a: 255}\n")
    (tmp_path / "launch.yaml").write_text(configs + "multibody configs: [good.yaml, bad.yaml, none.yaml]\n")

    def check(*words: str) -> tuple[int, str]:
        done = CliRunner().invoke(app, ["check", *words, str(tmp_path / "launch.yaml")])
        return done.exit_code, done.output

    chosen, everything = check("-l", "0")[1], check()[1]
    assert "bad.yaml" not in chosen and "none.yaml" not in chosen
    assert "bad.yaml:2:" in everything and "none.yaml' does not exist" in everything
    status, output = check("-l", "0,1")
    assert status == 1 and "bad.yaml:2:" in output and "none.yaml' does not exist" not in output
    assert "model index 7 is out of range" in check("-l", "0,7")[1]


SHADERS = "{path: glsl, vertex: a.vs, fragment: a.fs}"


@pytest.mark.parametrize("present", [[], ["a.vs"], ["a.vs", "a.fs"]])
@pytest.mark.parametrize("place", ["model", "body", "camera", "world"])
def test_a_missing_shader_is_reported_once_where_it_is_named(tmp_path: Path, place: str, present: list[str]) -> None:
    """A picture shows it only to those who look for it: the built-in shader draws in its place."""
    texts = {
        "world.yaml": "environment: floor.yaml\ncameras: [C]\nlights: []\nnamespace: /n/\nC: {name: c, location: {x: 1, y: 0, z: 0}%s}\n",
        "floor.yaml": "bodies: [F]\nnamespace: /n/\nF: {name: f, mass: 0.0}\n",
        "model.yaml": "bodies: [B, D]\nnamespace: /n/\nB: {name: b, mass: 0.0%s}\nD: {name: d, mass: 0.0}\n",
        "devices.yaml": "input devices: []\n",
        "launch.yaml": "world config: world.yaml\ncolor config: c.yaml\ninput devices config: devices.yaml\n"
        "multibody configs: [model.yaml]\n",
    }
    texts["world.yaml"] %= f", preprocessing shaders: {SHADERS}" if place == "camera" else ""
    texts["model.yaml"] %= f", shaders: {SHADERS}" if place == "body" else ""
    if place in ("world", "model"):
        texts[f"{place}.yaml"] += f"shaders: {SHADERS}\n"
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "glsl").mkdir()
    for name in present:
        (tmp_path / "glsl" / name).write_text("void main() {}")
    found = [d for d in findings(tmp_path / "launch.yaml", [], False) if d.severity >= Severity.WARNING]
    if len(present) == 2:
        assert found == []
    else:
        (finding,) = found
        lacking = "a.fs" if present else "a.vs"
        assert f"{lacking}' does not exist" in finding.message
        assert finding.severity is Severity.WARNING and finding.hint == "the built-in shader is used instead"
        assert finding.mark is not None and finding.mark.file.stem == (
            "world" if place in ("world", "camera") else "model"
        )


@pytest.mark.parametrize("shape", [{}, {"collision shape": "SPHERE", "collision geometry": {"radius": 1}}])
def test_what_is_wrong_in_a_mesh_that_is_only_drawn_is_reported(tmp_path: Path, shape: dict[str, object]) -> None:
    body = {"name": "a", "mass": 1, "mesh": "a.obj", "collision mesh": "", **shape}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"namespace": "/t/", "bodies": ["A"], "A": body}))
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd wood.png\n")
    (tmp_path / "a.obj").write_text(TRIANGLE)
    words = "\n".join(map(str, findings(tmp_path / "m.yaml", [], False)))
    assert "m.mtl:2:1: warning: texture 'wood.png' does not exist" in words
    (tmp_path / "a.obj").write_text(TRIANGLE.replace("f 1 2 3", "f 1 2 33"))
    words = "\n".join(map(str, findings(tmp_path / "m.yaml", [], False)))
    assert "a.obj:7:1: warning: a face names vertex 33, but 4 are defined so far" in words


def test_a_volume_alone_is_checked_and_runs_alone(tmp_path: Path) -> None:
    images = {"path": "./", "prefix": "slice", "format": "png", "count": 2}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"volumes": ["V"], "V": {"name": "v", "images": images}}))
    assert "has no file slice0.png or such" in errors(findings(tmp_path / "m.yaml", [], False))[0]
    for number in range(3):
        Image.new("L", (4, 4), 255).save(tmp_path / f"slice{number}.png")
    found = findings(tmp_path / "m.yaml", [], False)
    assert errors(found) == [] and not any("runs only together" in d.message for d in found)


def test_pictures_of_the_sky_that_are_missing_are_reported(tmp_path: Path) -> None:
    faces = ("right", "left", "top", "bottom", "front", "back")
    world = {"lights": [], "skybox": {"path": "sky", **{face: f"{face}.png" for face in faces}}}
    (tmp_path / "w.yaml").write_text(yaml.safe_dump(world))
    (tmp_path / "m.yaml").write_text("bodies: [BODY a]\nBODY a: {name: a, mass: 1}\n")
    launch = "world config: w.yaml\ninput devices config: d.yaml\ncolor config: c.yaml\nmultibody configs: [m.yaml]\n"
    (tmp_path / "launch.yaml").write_text(launch)
    (tmp_path / "sky").mkdir()
    for face in faces[:3]:
        Image.new("RGB", (2, 2)).save(tmp_path / "sky" / f"{face}.png")
    found = [d.message for d in findings(tmp_path / "launch.yaml", [], False) if d.message.startswith("sky box")]
    assert found == [f"sky box: the picture '{face}.png' of its {face} does not exist" for face in faces[3:]]


@pytest.mark.parametrize("key", ["map_Kd", "map_Bump", "map_Pr", "map_Pm", "map_ao", "refl"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0], ids=lambda share: f"{share:g} of it")
def test_pictures_that_cannot_be_read_are_reported_whatever_they_are_for(
    tmp_path: Path, key: str, share: float
) -> None:
    picture = tmp_path / "t.png"
    Image.effect_noise((32, 32), 50.0).save(picture)
    whole = picture.read_bytes()
    picture.write_bytes(whole[: int(share * len(whole))])
    (tmp_path / "a.obj").write_text(TRIANGLE)
    (tmp_path / "m.mtl").write_text(f"newmtl a\n{key} t.png\n")
    body = {"name": "a", "mass": 1, "mesh": "a.obj", "collision shape": "SPHERE", "collision geometry": {"radius": 1}}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"bodies": ["A"], "A": body}))
    found = [d for d in findings(tmp_path / "m.yaml", [], False) if "not a picture" in d.message]
    assert [d.mark.file for d in found if d.mark] == ([] if share == 1.0 else [picture])


def test_what_else_is_wrong_is_reported_where_no_body_is_left(tmp_path: Path) -> None:
    box = "collision shape: BOX, collision geometry: {x: 0,1, y: 1, z: 1}"
    (tmp_path / "m.yaml").write_text(f"bodies: [A]\nA: {{name: a, mass: 1, gravty: 0, {box}}}\n")
    found = findings(tmp_path / "m.yaml", (), strict=False)
    assert [d.severity for d in found] == [Severity.WARNING, Severity.WARNING, Severity.ERROR]
    assert [d.hint for d in found][:2] == [
        "did you mean 'gravity'?", "a comma ends a number; write a point before '1', as in 0.5",
    ]  # fmt: skip
