"""The commands as a user types them: check, bench, decompose, run of bad files, and errors that help."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from ligature.cli import ambf_simulator
from ligature.cli.main import app
from typer.testing import CliRunner

BIN = Path(sys.executable).parent
SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


def ligature(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([BIN / "ligature", *map(str, words)], capture_output=True, text=True, timeout=120)


def test_check_of_a_good_scene_ends_with_zero() -> None:
    done = ligature("check", SMALL)
    assert done.returncode == 0, done.stdout
    assert f"{SMALL}: 0 errors, 0 warnings" in done.stdout
    assert "40 bodies from '/ambf/env/phantom/BODY Thread' on are simulated as one elastic rod" in done.stdout


def test_the_package_runs_as_the_command_of_its_interpreter(tmp_path: Path) -> None:
    words = ["check", str(tmp_path / "none.yaml")]
    done = subprocess.run([sys.executable, "-m", "ligature", *words], capture_output=True, text=True, timeout=120)
    named = ligature(*words)
    assert (done.returncode, done.stdout, done.stderr) == (named.returncode, named.stdout, named.stderr)
    assert done.returncode == 1 and "does not exist" in done.stdout


def test_check_names_file_line_and_column(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("bodies: [BODY a]\nBODY a:\n  name: a\n  mass: heavy\n")
    done = ligature("check", bad)
    assert done.returncode == 1
    assert f"{bad}:4:9: error: 'mass' of body 'BODY a' is not usable; expected a number" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr


def test_check_of_a_missing_file_reports_it(tmp_path: Path) -> None:
    done = ligature("check", tmp_path / "none.yaml")
    assert done.returncode == 1 and "does not exist" in done.stdout


def test_compile_takes_no_file_or_the_name_of_a_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    from ligature.cli import compile as module
    from ligature.cli.main import app

    asked: list[list[Path]] = []
    monkeypatch.setattr(module, "compile_ahead", lambda scenes, console: asked.append(list(scenes)) or 0)
    assert CliRunner().invoke(app, ["compile"]).exit_code == 0
    assert CliRunner().invoke(app, ["compile", "suturing_small"]).exit_code == 0
    assert asked == [[], [SMALL]]


def test_bench_prints_its_figures_as_json() -> None:
    done = ligature("bench", SMALL, "--seconds", "0.5", "--json")
    figures = json.loads(done.stdout)
    assert figures["ticks_per_second"] > 0 and set(figures["phases_us"]) >= {"control", "suture", "bodies"}
    assert figures["tick_p50_us"] <= figures["tick_p99_us"] <= figures["tick_max_us"]


def test_bench_of_a_bad_file_ends_with_two(tmp_path: Path) -> None:
    done = ligature("bench", tmp_path / "none.yaml")
    assert done.returncode == 2 and "does not exist" in " ".join(done.stdout.split())  # rich wraps long paths


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("check suturing --root none", "'none' does not exist"),
        ("run suturing --root file", "'file' is a file"),
        ("demo --episodes 3", "--episodes describes a dataset"),
        ("replay run.record --page --dataset a.h5", "it must be without --dataset"),
        ("replay run.record --joints measured", "a record is simulated as fast as possible"),
        ("replay run.record -s 2", "a record is simulated as fast as possible"),
    ],
)
def test_options_that_would_have_no_effect_are_reported(
    words: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    Path("run.record").write_text('{"format": "ligature record 3"}')
    done = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert done.exit_code in (1, 2) and message in " ".join(done.output.split()), done.output


def test_ambf_simulator_names_a_root_that_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        ambf_simulator.options_of(["--launch_file", "x", "--root", "none"])
    assert "--root 'none' is not a folder" in capsys.readouterr().err


def test_score_takes_the_former_name_of_its_timeout(tmp_path: Path) -> None:
    bag = tmp_path / "none.bag"
    former, current = (
        ligature("score", "suture", bag, "--patience", "2"),
        ligature("score", "suture", bag, "--timeout", "2"),
    )
    assert "'--patience' is deprecated; write '--timeout'" in former.stderr
    assert "deprecated" not in current.stderr
    assert (former.returncode, former.stdout) == (current.returncode, current.stdout)
    assert "--patience" not in ligature("score", "--help").stdout


def test_a_list_of_indices_that_is_none_is_reported() -> None:
    done = ligature("bench", SMALL, "-l", "1,x")
    assert done.returncode == 2 and "'1,x' is not a list of whole numbers" in done.stdout + done.stderr


def test_run_of_a_bad_file_ends_and_states_why(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("bodies: [")
    done = ligature("run", bad)
    assert done.returncode == 2
    assert "bad.yaml:" in done.stdout and "Traceback" not in done.stdout


def test_decompose_writes_one_material_per_hull(tmp_path: Path) -> None:
    corners = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in corners]
    lines += ["f 6 5 4 3 2 1".replace("6 5 4 3 2 1", "1 4 3 "), "f 1 3 2", "f 1 6 5", "f 1 5 4"]
    lines += ["f 7 9 10", "f 7 8 9", "f 7 11 12", "f 7 10 11"]
    for i in range(6):
        a, b = i + 1, (i + 1) % 6 + 1
        lines += [f"f {a} {b} {b + 6}", f"f {a} {b + 6} {a + 6}"]
    mesh = tmp_path / "ell.obj"
    mesh.write_text("\n".join(lines) + "\n")
    done = ligature("decompose", mesh)
    assert done.returncode == 0, done.stdout
    text = (tmp_path / "ell_collision.obj").read_text()
    hulls = text.count("usemtl")
    assert hulls >= 2 and (tmp_path / "ell_collision.mtl").read_text().count("newmtl") == hulls
    assert f"{hulls} hulls" in done.stdout


def test_decompose_of_nonsense_states_where(tmp_path: Path) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0 0\nf 1 2 3\n")
    done = ligature("decompose", tmp_path / "bad.obj")
    assert done.returncode == 1 and "bad.obj:2:1: error: a face names vertex 2, but 1 are defined" in done.stdout


def test_render_writes_pictures_calibration_and_annotations(tmp_path: Path) -> None:
    done = ligature(
        "render", SMALL, "--camera", "cameraL", "--out", tmp_path / "out", "--width", 160, "--height", 120,
        "--format", "exr", "--annotations", "coco,mask", "--noise", 0.01,
    )  # fmt: skip
    if "no OpenGL" in done.stdout:
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stdout
    names = {"cameraL.png", "cameraL.exr", "cameraL_camera.json", "cameraL_coco.json", "cameraL_mask.png"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names | {"cameraL_mask.json"}
    seen = json.loads((tmp_path / "out" / "cameraL_coco.json").read_text())
    names_of = {c["id"]: c["name"] for c in seen["categories"]}
    assert "/ambf/env/phantom/BODY Needle" in {names_of[a["category_id"]] for a in seen["annotations"]}
    assert json.loads((tmp_path / "out" / "cameraL_camera.json").read_text())["width"] == 160


def test_render_names_the_cameras_there_are(tmp_path: Path) -> None:
    done = ligature("render", SMALL, "--camera", "cameraX", "--out", tmp_path)
    assert done.returncode == 1
    assert "'cameraX' does not name exactly one camera" in done.stdout and "cameras/cameraL" in done.stdout


def test_render_refuses_what_it_cannot_write(tmp_path: Path) -> None:
    assert "npy, png, exr" in ligature("render", SMALL, "--camera", "cameraL", "--format", "gif").stderr
    assert "five numbers" in ligature("render", SMALL, "--camera", "cameraL", "--distortion", "1,2").stderr
    assert "between 0 and 10" in ligature("render", SMALL, "--camera", "cameraL", "--noise", "11").stderr
    assert "finite" in ligature("render", SMALL, "--camera", "cameraL", "--seconds", "nan").stderr


def test_demo_names_the_example_that_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from ligature.cli import demo
    from rich.console import Console

    monkeypatch.setattr(demo, "EXAMPLE", tmp_path / "suture.py")
    assert demo.demo(2, 0, tmp_path, None, Console(soft_wrap=True)) == 2
    assert f"the demonstration '{tmp_path / 'suture.py'}' is missing" in capsys.readouterr().out
    (tmp_path / "suture.py").write_text(
        "import sys; sys.exit(0 if sys.argv[1:4] == ['--throws', '2', '--seed'] else 3)"
    )
    assert demo.demo(2, 0, tmp_path, None, Console(soft_wrap=True)) == 0
    (tmp_path / "suture_tissue.py").write_text("import sys; sys.exit(sys.argv[1:3] != ['--seed', '7'])")
    assert demo.demo(2, 7, tmp_path, None, Console(soft_wrap=True), tissue=True) == 0
    (tmp_path / "close_wound.py").write_text("import sys; sys.exit(sys.argv[1:3] != ['--seed', '8'])")
    for tissue in (False, True):
        assert demo.demo(2, 8, tmp_path, None, Console(soft_wrap=True), tissue=tissue, knot=True) == 0
    for option in ("tissue", "knot"):
        assert demo.demo(2, 7, tmp_path, tmp_path / "d.h5", Console(soft_wrap=True), **{option: True}) == 2
        assert f"leave out --{option}, or --dataset" in capsys.readouterr().out


def test_render_warns_of_a_picture_that_is_mostly_white(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(
        "bodies: [Wall]\ncameras: [C]\nlights: [L]\n"
        "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.1, y: 9, z: 9}, location: {position: {x: -1, y: 0, z: 0}}, "
        "color rgba: {r: 0.9, g: 0.9, b: 0.9, a: 1}}\n"
        "C: {name: C, location: {x: 0, y: 0, z: 0}, look at: {x: -1, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, "
        "field view angle: 0.7, clipping plane: {near: 0.1, far: 10}}\n"
        "L: {name: L, location: {x: 0, y: 0, z: 0}, direction: {x: -1, y: 0, z: 0}, cutoff angle: 1.5, spot exponent: 0, "
        "attenuation: {constant: 0.1}}\n"
    )
    picture = ("render", tmp_path / "m.yaml", "--camera", "C", "--out", tmp_path / "out", "--width", 64, "--height", 48)
    bright, dark = ligature(*picture), ligature(*picture, "--exposure", -5)
    if "no OpenGL" in bright.stdout:
        pytest.skip(bright.stdout)
    assert "100% of the picture of C is saturated (white); lower --exposure" in bright.stdout
    assert bright.returncode == 0 and "saturated" not in dark.stdout
