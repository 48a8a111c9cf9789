"""Finds what is doubtful in tissue that can be simulated: numbers that contradict each other, or have no effect.

SI units, frames as in `ligature.model.scene`.
"""

from __future__ import annotations

import numpy as np

from ligature.adf import Diagnostic, Element, Severity
from ligature.adf.diagnostics import length, span
from ligature.model.frames import Array
from ligature.model.soft import TissueForm

FIRM, SOFTEST = 0.2, 0.5
"""Pressure of a column of its own height over Young's modulus, ρ g h / E, up to which tissue is firm; beyond the
second figure it sinks into what it lies on, or turns inside out."""

CONTRADICTION = 2.0
"""Mass over density times volume, or the reverse, that no rounding of figures explains."""

LARGEST = 2.0
"""Metres beyond which tissue is longer than a person, so that its mesh has another unit."""

ENDLESS = 100.0
"""Length of a slit over that of the body beyond which it has another unit."""


def doubts(element: Element, form: TissueForm, mass: float, turn: Array, gravity: Array) -> list[Diagnostic]:
    """What is doubtful in the tissue of ``mass`` kilograms that an element describes.

    ``turn`` (3, 3) are the axes of B in the world, and ``gravity`` (3,) is in world axes.
    """
    found = [
        *_size(element, form),
        *_weight(form, mass, gravity @ turn),
        *_masses(form, mass),
        *_hold(element, form, mass),
        *_slits(form),
        *_layers(element, form),
    ]
    return [
        Diagnostic(Severity.WARNING, f"{element.kind} '{element.key}' {what}", element.mark_of(key), hint, "tissue")
        for key, what, hint in found
    ]


Doubt = tuple[str, str, str]
"""Key that it is about, what is doubtful, and what would be right."""


def _size(element: Element, form: TissueForm) -> list[Doubt]:
    largest = float(np.ptp(form.grid.nodes, axis=0).max())
    if largest <= LARGEST:
        return []
    key = next((key for key in ("geometry", "mesh", "collision mesh") if element.has(key)), "ligature tissue")
    hint = "lengths are metres; give a mesh in millimetres 'scale: 0.001', one in centimetres 'scale: 0.01'"
    return [(key, f"is tissue {length(largest)} long", hint)]


def _weight(form: TissueForm, mass: float, gravity: Array) -> list[Doubt]:
    """Tissue that its weight would press flat; of layers the mean compliance counts."""
    strength = float(np.linalg.norm(gravity))
    if not strength > 0.0:
        return []
    height = float(np.ptp(form.grid.nodes @ gravity) / strength)
    volumes = form.grid.sizes.prod(axis=1)
    own = float(form.cell_masses.sum())
    density = (own if form.fixed.any() else max(own, mass)) / float(volumes.sum())
    soft = np.array([1.0 / material.youngs for material in form.materials])[form.grid.layer]
    young = float(volumes.sum() / (soft @ volumes))
    share = density * strength * height / young
    if share <= SOFTEST:
        return []
    what = f"is too soft for its weight: ρ g h / E is {share:.2g} with {density:.3g} kg/m³, {length(height)} along"
    right = f"give a Young's modulus of {young * share / FIRM:.2g} Pa or more, or a lower density"
    return [("ligature tissue.youngs modulus", f"{what} gravity and {young:.3g} Pa", right)]


def _masses(form: TissueForm, mass: float) -> list[Doubt]:
    own = float(form.cell_masses.sum())
    if form.fixed.any() or not mass > 0.0 or 1.0 / CONTRADICTION <= mass / own <= CONTRADICTION:
        return []
    what = f"has a mass of {mass:.3g} kg, but density times volume is {own:.3g} kg; its weight is that of 'mass'"
    hint = "remove 'mass', so that it follows from the density, or give the density that belongs to it, "
    return [("mass", what, f"{hint}{mass / float(form.grid.sizes.prod(axis=1).sum()):.3g} kg/m³")]


def _hold(element: Element, form: TissueForm, mass: float) -> list[Doubt]:
    if form.fixed.any() or element.kind != "body":
        return []
    if form.support:
        what = f"is carried by '{form.support}', but none of its faces is fixed, so that only its middle is carried"
        return [("ligature tissue.fixed", what, "give the faces that are, such as [-z], or remove 'carried by'")]
    if mass == 0.0:
        what = "hovers where it is: its 'mass' is 0, and none of its faces is fixed"
        return [("mass", what, "remove 'mass', so that the tissue falls, or fix faces, such as [-z]")]
    return []


def _slits(form: TissueForm) -> list[Doubt]:
    low, high = form.grid.nodes.min(axis=0), form.grid.nodes.max(axis=0)
    body = f"its tissue reaches {span(low, high)}"
    found = []
    for number, slit in enumerate(form.slits):
        begin, end = slit.min(axis=0), slit.max(axis=0)
        what = f"has slit {number + 1} {span(begin, end)}"
        if (end <= low).any() or (begin >= high).any():
            found.append(("ligature tissue.slits", f"{what}, outside, which cuts nothing", body))
        elif (end - begin > ENDLESS * (high - low)).any():
            found.append(("ligature tissue.slits", f"{what}, far beyond the body", f"lengths are metres; {body}"))
    return found


def _layers(element: Element, form: TissueForm) -> list[Doubt]:
    stated = element.children("ligature tissue.layers")
    thick = [float(item.value("thickness") or 0.0) for item in stated[:-1]]
    height = float(np.ptp(form.grid.nodes[:, 2]))
    found = []
    for number in sorted(set(range(len(stated))) - set(form.grid.layer.tolist())):
        above = sum(thick[:number])
        what = f"has no cell of layer {number + 1}: it begins {length(above)} below the top"
        hint = f"lengths are metres; the layers share {length(height)}"
        if above < height:
            what, hint = f"{what} and is too thin for a cell", f"make it thicker; {hint}"
        found.append(("ligature tissue.layers", what, hint))
    return found
