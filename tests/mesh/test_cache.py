"""Sanitised collision files: by content, whole, and as many hulls in Bullet as were given."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.mesh import CollisionCache, collision_parts, load_mesh
from ligature.physics import World  # noqa: F401  (imports Bullet without its banner)

from tests.mesh.shapes import CUBE


@pytest.fixture
def cache(tmp_path: Path) -> CollisionCache:
    return CollisionCache(tmp_path)


def test_equal_content_is_one_file(cache: CollisionCache) -> None:
    first = cache.hulls([CUBE, CUBE + 2])
    assert cache.hulls([CUBE, CUBE + 2]) == first
    assert cache.hulls([CUBE]) != first
    assert [path.suffix for path in cache.folder.iterdir()] == [".obj", ".obj"]


def test_bullet_makes_one_hull_of_each(cache: CollisionCache) -> None:
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    hulls = [CUBE * 0.1 + [i, 0, 0] for i in range(9)]
    shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(cache.hulls(hulls)), physicsClientId=client)
    body = pybullet.createMultiBody(1.0, shape, physicsClientId=client)
    gaps = np.array([[i + 0.5, 0.05, 0.05] for i in range(8)])
    inside = np.array([[i + 0.05, 0.05, 0.05] for i in range(9)])

    def hit(points: np.ndarray) -> list[bool]:
        results = pybullet.rayTestBatch(
            (points + [0, 0, 1]).tolist(), (points - [0, 0, 1]).tolist(), physicsClientId=client
        )
        return [r[0] == body for r in results]

    assert not any(hit(gaps)) and all(hit(inside))
    pybullet.disconnect(client)


def test_the_file_holds_exact_numbers_and_no_material(cache: CollisionCache) -> None:
    points = CUBE / 3.0 + 1e-17
    lines = cache.hulls([points, CUBE + 5]).read_text().splitlines()
    assert [line for line in lines if line[0] == "o"] == ["o hull0", "o hull1"]
    assert {line.split()[0] for line in lines} == {"o", "v", "f"}
    read = np.array([line.split()[1:] for line in lines if line[0] == "v"], dtype=float)
    assert np.array_equal(np.unique(read[:8], axis=0), np.unique(points, axis=0))
    named = np.array([line.split()[1:] for line in lines if line[0] == "f"], dtype=int)
    assert named.min() == 1 and named.max() == len(read)


def test_flat_and_tiny_hulls_name_every_corner(cache: CollisionCache) -> None:
    for points in (CUBE[:4], CUBE[:3], CUBE[:2], CUBE[:1], CUBE * 1e-9):
        text = cache.hulls([points]).read_text()
        named = {int(word) for line in text.splitlines() if line[0] == "f" for word in line.split()[1:]}
        assert named == set(range(1, len(points) + 1))


def test_triangles_without_area_are_left_out(cache: CollisionCache) -> None:
    faces = np.array([[0, 1, 2], [0, 0, 1], [0, 3, 4]], dtype=np.int32)
    text = cache.triangles(np.vstack([CUBE[:3], CUBE[1:2] * 2, CUBE[1:2] * 3]), faces).read_text()
    assert [line for line in text.splitlines() if line[0] == "f"] == ["f 1 2 3"]


def test_what_is_not_finite_is_refused(cache: CollisionCache) -> None:
    with pytest.raises(ValueError, match="not finite"):
        cache.hulls([CUBE * np.nan])


def test_a_damaged_file_is_written_again(cache: CollisionCache) -> None:
    path = cache.hulls([CUBE])
    whole = path.read_bytes()
    path.write_bytes(whole[:40])
    assert cache.hulls([CUBE]) == path and path.read_bytes() == whole


def test_processes_that_write_the_same_files_leave_whole_ones(tmp_path: Path) -> None:
    program = (
        "import numpy as np, sys\nfrom pathlib import Path\nfrom ligature.mesh import CollisionCache\n"
        "cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)\n"
        "for i in range(30): CollisionCache(Path(sys.argv[1])).hulls([cube + 0.1 * j for j in range(i)])\n"
    )
    started = [subprocess.Popen([sys.executable, "-c", program, str(tmp_path)]) for _ in range(3)]
    assert [process.wait() for process in started] == [0, 0, 0]
    files = sorted((tmp_path / "collision").iterdir())
    assert len(files) == 30
    for file in files:
        assert hashlib.sha256(file.read_bytes()).hexdigest().startswith(file.stem)


def test_a_disk_without_room_is_an_error_that_names_both_folders(tmp_path: Path) -> None:
    """A limit on the size of files stands for the full disk."""
    program = (
        "import numpy as np, resource, sys\nfrom pathlib import Path\nfrom ligature.mesh import CacheError, CollisionCache\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
        "try: CollisionCache(Path(sys.argv[1])).hulls([np.random.rand(20, 3)])\n"
        "except CacheError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True)
    assert f"collision files cannot be written to {tmp_path}/collision (File too large) nor to " in done.stdout
    assert "free some space or set LIGATURE_CACHE" in done.stdout
    assert list((tmp_path / "collision").iterdir()) == []


def test_a_folder_that_cannot_be_written_is_replaced_and_stated(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    cache = CollisionCache(tmp_path / "file" / "below")
    path = cache.hulls([CUBE])
    assert path.is_file() and cache.hulls([CUBE]) == path
    (record,) = caplog.records
    assert "cannot be written (Not a directory); " in record.getMessage()


def test_the_corpus_needle_is_nine_pieces_in_bullet_and_not_one(cache: CollisionCache, corpus: Path) -> None:
    """Rays through the open side of the arc meet nothing; they would meet the one hull of all vertices."""
    import pybullet

    folder = corpus / "suturing_scene" / "ADF" / "Phantoms" / "Simple" / "low_res"
    pieces = collision_parts(load_mesh(folder / "NeedleCollision.OBJ", Resolver([corpus])), "hull")
    hulls = [piece.vertices for piece in pieces]
    client = pybullet.connect(pybullet.DIRECT)

    def hits(file: Path) -> tuple[list[bool], bool]:
        shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(file), physicsClientId=client)
        body = pybullet.createMultiBody(1.0, shape, physicsClientId=client)
        normal = np.linalg.svd(np.vstack(hulls) - np.vstack(hulls).mean(axis=0))[2][2]
        centres = np.array([hull.mean(axis=0) for hull in hulls] + [np.vstack(hulls).mean(axis=0)])
        ends = (centres + 0.05 * normal).tolist(), (centres - 0.05 * normal).tolist()
        met = [result[0] == body for result in pybullet.rayTestBatch(*ends, physicsClientId=client)]
        pybullet.removeBody(body, physicsClientId=client)
        return met[:-1], met[-1]

    assert hits(cache.hulls(hulls)) == ([True] * 9, False)
    assert hits(cache.hulls([np.vstack(hulls)]))[1]
    pybullet.disconnect(client)


@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n",
        "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
        "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
    ],
    ids=["out of range", "negative", "nan", "faces first"],
)
def test_a_malformed_file_never_reaches_bullet(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bullet crashes or hangs on each of these; a scene that names one is refused with its place."""
    import ligature
    import pybullet

    given: list[object] = []
    for name in ("createCollisionShape", "createCollisionShapeArray"):
        monkeypatch.setattr(pybullet, name, lambda *a, **k: given.append((a, k)))
    (tmp_path / "m.obj").write_text(text)
    (tmp_path / "m.yaml").write_text("bodies: [BODY a]\nBODY a: {name: a, mass: 1, mesh: m.obj}\n")
    with pytest.raises(ligature.SceneError, match=r"m.obj:\d:1: error: a "):
        ligature.Simulation(ligature.load(tmp_path / "m.yaml"))
    assert given == []
