"""Libraries that we call leave the process as it was: how its threads are scheduled, signals, numbers, locale, limits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

LOOK = """
import locale, os, resource, signal, sys
from pathlib import Path

def look():
    hasty = set()
    for thread in map(int, os.listdir("/proc/self/task")):
        try:
            if os.sched_getscheduler(thread) in (os.SCHED_FIFO, os.SCHED_RR):
                hasty.add(os.sched_getparam(thread).sched_priority)
        except OSError:
            pass
    mask = os.umask(0)
    os.umask(mask)
    tiny = 5e-324
    return {
        "hasty": hasty, "nice": os.nice(0), "processors": os.sched_getaffinity(0), "umask": mask, "folder": os.getcwd(),
        "signals": {n: signal.getsignal(n) for n in signal.valid_signals()}, "locale": locale.setlocale(locale.LC_ALL),
        "blocked": signal.pthread_sigmask(signal.SIG_BLOCK, ()), "denormals": tiny * 3.0 / 3.0 == tiny,
        "limits": [resource.getrlimit(getattr(resource, n)) for n in dir(resource) if n.startswith("RLIMIT_")],
        "hooks": (sys.excepthook, sys.unraisablehook, sys.displayhook), "recursion": sys.getrecursionlimit(),
        "scratch": sorted(p for p in os.listdir(".") if not p.startswith("out")),
    }

before, variables = look(), dict(os.environ)
"""
END = """
after = look()
print({key: (before[key], after[key]) for key in before if before[key] != after[key]}, "changed")
# ours, set before numpy is imported, for the same bits on all processors; and gymnasium's, which hinders no one
own = {"OPENBLAS_CORETYPE", "PYGAME_HIDE_SUPPORT_PROMPT"}
found = {*variables, *os.environ} - own
print({k: (variables.get(k), os.environ.get(k)) for k in found if variables.get(k) != os.environ.get(k)})
"""
SCENE = """
import ligature
from ligature import Simulation
sim = Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))
sim.step(20)
"""
USES = {
    "h264": "from ligature.datasets.lerobot import video\n"
    "video.encode(Path('out.mp4'), [np.zeros((48, 64, 3), np.uint8)] * 3, (64, 48), 30, video.CODECS['h264'])",
    "av1": "from ligature.datasets.lerobot import video\n"
    "video.encode(Path('out.mp4'), [np.zeros((48, 64, 3), np.uint8)] * 3, (64, 48), 30, video.CODECS['av1'])",
    "picture": SCENE + "sim.cameras['cameraL'].capture()",
    "decomposition": "from ligature.mesh import Mesh, MeshPart\nfrom ligature.mesh.decompose import decompose\n"
    "sys.path.append(str(ROOT))\nfrom tests.mesh.shapes import ell\ndecompose(Mesh(Path('/ell.obj'), (MeshPart('', *ell()),)))",
    "environment": "import gymnasium, ligature.environments\n"
    "env = gymnasium.make('ligature/Reach-v0')\nenv.reset(seed=0)\nenv.step(env.action_space.sample())",
    "arrays": "import h5py, pyarrow.parquet, pyarrow\n"
    "pyarrow.parquet.write_table(pyarrow.table({'a': [1.0]}), 'out.parquet')\nh5py.File('out.h5', 'w').close()",
    "network": "import onnxruntime",
}


@pytest.mark.parametrize("use", USES)
def test_a_library_leaves_the_process_as_it_was(use: str, tmp_path: Path) -> None:
    code = f"{LOOK}\nimport numpy as np\nROOT = Path({str(Path(__file__).resolve().parents[1])!r})\n{USES[use]}\n{END}"
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-2:] == ["{} changed", "{}"], run.stdout
