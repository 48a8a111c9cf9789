"""Opens files for a scene, below the scene's own roots only.

Paths in scene files are joined textually to the folder of the file that names them, as in
AMBF; symbolic links are resolved before the roots are compared.
"""

from __future__ import annotations

import codecs
import os
import re
import sys
from collections import abc
from collections.abc import Iterable
from pathlib import Path

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.lacking import instead_of_url, lack_of
from ligature.adf.lines import lines_of
from ligature.adf.nodes import Node, Scalar, Sequence, parse
from ligature.paths import check_list, open_file, real_path

MAX_BYTES = 256 * 1024 * 1024
"""Largest file that is read unless the caller sets otherwise."""

MAX_PATH, MAX_NAME = 4000, 255
"""Longest path in characters and longest file name in bytes that file systems take."""

SEARCH_PATH = "LIGATURE_SCENE_PATH"
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
_HASH = re.compile("[0-9a-f]{16}")
"""What the names in stores of contents have."""

_ROOT_SIGNS = (".git", "package.xml")
_LAUNCH_KEYS = ("world config", "color config", "input devices config", "multibody configs")
_LAUNCH_SIGN = re.compile(r"(?:^|[\r\n{,])[ \t]*['\"]?(?:multibody configs|world config)")
_MARKED = (
    (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"),
)  # fmt: skip
"""Byte order marks of encodings that YAML allows besides UTF-8, as Windows writes them; the longer ones first."""
MAX_LAUNCH_FILES, MAX_LAUNCH_BYTES = 200, 1024 * 1024
"""Most files of a folder, and the largest in bytes, that are looked at for being a launch file."""


class ResolutionError(AdfError):
    """A path that may not be opened or does not exist; ``diagnostic`` is the reason."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(diagnostic)
        self.diagnostic = diagnostic


class Resolver:
    """Turns references into paths below ``roots`` and reads them.

    Parameters
    ----------
    roots
        Folders below which files may be opened.
    """

    def __init__(self, roots: abc.Sequence[Path]) -> None:
        check_list("roots", roots)
        self.roots = tuple(real_path(Path(root)) for root in roots)

    @classmethod
    def for_file(cls, path: Path, extra_roots: Iterable[Path] = ()) -> Resolver:
        """A resolver for the scene of ``path``, the file that the user named.

        Its root is that of `scene_root`; ``extra_roots`` and the folders of ``LIGATURE_SCENE_PATH`` are added.
        """
        check_list("roots", extra_roots)
        listed = os.environ.get(SEARCH_PATH, "")
        more = [Path(item) for item in listed.split(os.pathsep) if item]
        return cls([scene_root(Path(path)), *extra_roots, *more])

    def resolve(self, reference: str, base: Path, mark: Mark | None = None) -> Path:
        """The path that ``reference`` means in a file of the folder ``base``.

        Raises `ResolutionError`, which names ``mark``, the place in the file that refers to it.
        """
        if "\0" in reference:
            raise self._refusal("the path contains a zero byte", mark, "write the path without it")
        if _URL.match(reference):
            raise self._refusal(f"'{reference}' is a URL", mark, instead_of_url(reference))
        return self.allow(Path(os.path.join(base, reference)), mark)

    def allow(self, path: Path, mark: Mark | None = None) -> Path:
        """``path`` with links resolved, if it lies below a root; raises `ResolutionError` at ``mark``.

        A link into a store of contents keeps its name and folder (`place_of`), where both it and the content lie below.
        """
        real = self._real(path, mark)
        place = place_of(path, real)
        return place if self._covers(place) else real

    def _covers(self, path: Path) -> bool:
        return any(path == root or root in path.parents for root in self.roots)

    def _real(self, path: Path, mark: Mark | None) -> Path:
        """``path`` with all links resolved, if it lies below a root."""
        if "\0" in str(path):
            raise self._refusal("the path contains a zero byte", mark, "write the path without it")
        if len(str(path)) > MAX_PATH or any(len(part.encode("utf-8", "replace")) > MAX_NAME for part in path.parts):
            raise self._refusal(f"the path '{str(path)[:60]}…' is too long for a file", mark, "give a shorter one")
        try:
            os.fsencode(path)
        except UnicodeEncodeError:
            raise self._refusal(
                f"{ascii(str(path))} has letters that names of files cannot have in the encoding "
                f"'{sys.getfilesystemencoding()}'", mark, "use others, or set LC_ALL=C.UTF-8",
            ) from None  # fmt: skip
        real = real_path(path)
        if not self._covers(real):
            roots = ", ".join(map(str, self.roots))
            lack = lack_of(real)
            if lack is not None and not real.is_dir():
                message = f"'{real}' {lack.fault}, and lies outside the scene's folders ({roots})"
                raise self._refusal(message, mark, lack.hint or "give a file below them")
            raise self._refusal(
                f"'{real}' lies outside the scene's folders ({roots})",
                mark,
                f"allow it with --root {self._wider_root(real)} or {SEARCH_PATH}",
            )
        return real

    def exists(self, path: Path) -> bool:
        """Whether ``path`` is a file that may be opened."""
        try:
            return self.allow(path).is_file()
        except (ResolutionError, OSError):
            return False

    def read_bytes(self, path: Path, limit: int = MAX_BYTES, mark: Mark | None = None) -> bytes:
        """The content of ``path``, at most ``limit`` bytes; raises `ResolutionError` at ``mark``."""
        real = self._real(path, mark)
        try:
            lack = lack_of(real)
            if lack is not None:
                raise self._refusal(f"'{real}' {lack.fault}", mark, lack.hint)
            with open_file(real) as file:
                if os.fstat(file.fileno()).st_size > limit:
                    raise self._refusal(f"'{real}' is larger than {limit} bytes", mark, "split it, or reduce it")
                return file.read()
        except OSError as error:
            raise self._refusal(f"'{real}' cannot be read: {error.strerror}", mark, "give another file") from error

    def read_text(self, path: Path, limit: int = MAX_BYTES, mark: Mark | None = None) -> str:
        """The content of ``path`` as text, at most ``limit`` bytes: UTF-8, or what its byte order mark states.

        Raises `ResolutionError` at ``mark``, or at the byte that is not text.
        """
        data = self.read_bytes(path, limit, mark)
        try:
            return decoded(data)
        except UnicodeDecodeError as error:
            name = "-".join(error.encoding.upper().split("-")[:2])
            before = lines_of(data[: error.start].decode(error.encoding, "replace").lstrip("\ufeff"))
            place = Mark(Path(path), len(before), len(before[-1]) + 1)
            raise self._refusal(
                f"'{path}' is not {name} text (byte {error.start})", place, "save it as UTF-8"
            ) from error

    def _wider_root(self, path: Path) -> Path:
        """The smallest folder around a root and ``path``; the path's own where that would be all of a disk or home."""
        around = (Path(os.path.commonpath([root, path])) for root in self.roots)
        narrow = [folder for folder in around if not _too_wide(folder)]
        return max(narrow, key=lambda folder: len(folder.parts), default=path.parent)

    @staticmethod
    def _refusal(message: str, mark: Mark | None, hint: str = "") -> ResolutionError:
        return ResolutionError(Diagnostic(Severity.ERROR, message, mark, hint, "path"))


def decoded(data: bytes) -> str:
    """The text of a scene file: UTF-8, or what its byte order mark states; raises UnicodeDecodeError."""
    return data.decode(next((encoding for mark, encoding in _MARKED if data.startswith(mark)), "utf-8-sig"))


def scene_root(path: Path) -> Path:
    """The folder below which the scene of ``path``, the file that the user named, may open files.

    The repository or ROS package that encloses the file. Without one (a downloaded archive), the folder above that of
    the highest launch file around it which names a file of the same branch: that launch file may open the same
    folder. Else the folder above the file's own. Never all of a disk, nor what lies above the user's home.
    """
    folder = place_of(path, real_path(path)).parent
    for candidate in (folder, *folder.parents):
        if any((candidate / sign).exists() for sign in _ROOT_SIGNS):
            return candidate
    scene = folder
    for candidate, branch in zip(folder.parents, (folder, *folder.parents), strict=False):
        if not _too_wide(candidate) and _launches(candidate, branch):
            scene = candidate
    return scene if scene.parent == scene.parent.parent or _above_home(scene.parent) else scene.parent


def place_of(path: Path, real: Path) -> Path:
    """Where the file of ``path`` is, which is ``real`` with links followed, but for a link into a store of contents.

    Version control of large files (git-annex, DVC) and hubs of data sets keep files under the hash of their content,
    and link to them by the right names: the format and the neighbours of such a file are those of the link.
    """
    if real.name == path.name or not _HASH.search(real.name) or not os.path.islink(path):
        return real
    return real_path(path.parent) / path.name


def _too_wide(folder: Path) -> bool:
    """Whether ``folder`` is too wide for a root: a whole disk, a whole home folder, or more."""
    return folder == folder.parent or _above_home(folder) or folder == _home()


def _above_home(folder: Path) -> bool:
    return folder in _home().parents


def _home() -> Path:
    return real_path(Path(os.path.expanduser("~")))


def _launches(folder: Path, branch: Path) -> bool:
    """Whether a launch file in ``folder`` names a file in its subfolder ``branch``."""
    try:
        candidates = sorted(folder.glob("*.y*ml"))[:MAX_LAUNCH_FILES]
    except OSError:
        return False
    return any(branch in file.parents for launch in candidates for file in _named_files(launch))


def _named_files(launch: Path) -> list[Path]:
    """The files that a launch file names; none when it is something else or cannot be read."""
    try:
        if not launch.is_file() or launch.stat().st_size > MAX_LAUNCH_BYTES:
            return []
        text = decoded(launch.read_bytes())
        if not _LAUNCH_SIGN.search(text):
            return []
        top = parse(text, launch)
    except (OSError, UnicodeDecodeError, AdfError):
        return []
    named = []
    for key in _LAUNCH_KEYS:
        value = top.entries[key][1] if key in top.entries else None
        items: list[Node | None] = [*value.items] if isinstance(value, Sequence) else [value]
        named += [item.text for item in items if isinstance(item, Scalar) and item.text and "\0" not in item.text]
    return [Path(os.path.normpath(os.path.join(launch.parent, text))) for text in named if len(text) <= MAX_PATH]
