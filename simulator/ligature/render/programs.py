"""The built-in shader programs, one for each set of features, compiled when first needed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

import moderngl

_INCLUDE = re.compile(r'^#include "(\w+\.glsl)"$', re.MULTILINE)

_SAMPLERS = range(0x8B5D, 0x8B63)
"""OpenGL's numbers of the types sampler1D to sampler2DShadow, samplerCube among them."""

Defines = frozenset[tuple[str, int]]


@cache
def source(name: str) -> str:
    """A shader file of this room, with the files it includes."""
    text = resources.files("ligature.render").joinpath("glsl", name).read_text(encoding="utf-8")
    return _INCLUDE.sub(lambda match: source(match[1]), text)


class Program:
    """A linked program with its uniforms by name; setting one that the compiler dropped does nothing."""

    def __init__(self, linked: moderngl.Program) -> None:
        self.linked = linked
        self._uniforms: dict[str, moderngl.Uniform] = {}
        self._values: dict[str, Any] = {}
        self.attributes: list[str] = []
        self.samplers: list[str] = []
        for name in linked:
            member = linked[name]
            if isinstance(member, moderngl.Uniform):
                self._uniforms[name.removesuffix("[0]")] = member  # an array of one keeps its index
                if member.gl_type in _SAMPLERS:  # type: ignore[attr-defined]
                    self.samplers.append(name)
            elif isinstance(member, moderngl.Attribute):
                self.attributes.append(name)

    def __contains__(self, name: str) -> bool:
        return name in self._uniforms

    def set(self, name: str, value: Any) -> None:
        """Set a uniform to a number or tuple, or an array to a list of them, as far as the compiler kept it.

        No other way sets that uniform: one that has the value already is not set again.
        """
        uniform = self._uniforms.get(name)
        if uniform is None:
            return
        if isinstance(value, list):
            value = value[: uniform.array_length] if uniform.array_length > 1 else value[0]
        if self._values.get(name) != value:  # a program keeps it from picture to picture
            uniform.value = self._values[name] = value

    def write(self, name: str, matrix: Any) -> None:
        """Set a uniform to ``matrix`` (n, n), or an array to matrices (m, n, n), as far as the compiler kept it."""
        uniform = self._uniforms.get(name)
        if uniform is not None:
            kept = matrix if matrix.ndim == 2 else matrix[: uniform.array_length]
            uniform.write(kept.swapaxes(-1, -2).astype("f4").tobytes())


class Programs:
    """The built-in programs of one context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._linked: dict[tuple[str, Defines], Program] = {}

    def get(self, name: str, defines: Mapping[str, int]) -> Program:
        """The program of ``name.vert`` and ``name.frag`` with ``defines``."""
        key = (name, frozenset(defines.items()))
        if key not in self._linked:
            header = "#version 330 core\n" + "".join(f"#define {n} {v}\n" for n, v in sorted(defines.items()))
            vertex, fragment = (header + source(f"{name}.{stage}") for stage in ("vert", "frag"))
            self._linked[key] = Program(self._context.program(vertex, fragment))
        return self._linked[key]
