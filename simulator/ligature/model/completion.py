"""Completes a scene with everything that depends on all of its objects.

Parents of mounted objects, rods, trees and loops, arms, needles, holes and jaws.
"""

from __future__ import annotations

from ligature.model import trees
from ligature.model.arms import find_arms
from ligature.model.assembly import assemble
from ligature.model.builder import SceneBuilder
from ligature.model.holes import find_holes
from ligature.model.jaws import find_jaws
from ligature.model.needles import find_needles
from ligature.model.rods import find_rods
from ligature.model.scene import Scene
from ligature.model.tissue import tissue_findings


def completed(built: SceneBuilder) -> Scene:
    """The scene of everything that was built."""
    diagnostics, joints = built.diagnostics, built.joints
    built.arrivals.report_orphans()
    ghosts = built.arrivals.attached("ghost", built.ghosts)
    built.lost.name_what_goes_along(diagnostics)
    diagnostics += built.arrivals.diagnostics
    rods, placed, found = find_rods(built.bodies, joints, built.sensors, frozenset(built.no_rod))
    diagnostics += found
    rod_bodies = frozenset(b for rod in rods for b in rod.bodies)
    rod_joints = frozenset(j for rod in rods for j in (*rod.joints, *rod.anchors))
    bodies = trees.connected(placed, joints, built.linked, built.silent_files, built.groups)
    forest, loops = trees.articulations(bodies, joints, rod_bodies, rod_joints)
    start, closures, found = assemble(bodies, joints, forest, loops)
    diagnostics += found
    movable = [joint for joint in joints if joint.index not in {*loops, *rod_joints}]
    arms, found = find_arms(bodies, movable, built.files.world.extra.get("ligature arms"))
    diagnostics += found
    needles, found = find_needles(bodies, joints, forest, rods)
    diagnostics += found + tissue_findings(bodies)
    holes, found = find_holes(ghosts, bodies)
    diagnostics += found
    return Scene(
        name=built.files.name,
        world=built.files.world,
        models=tuple(built.models),
        bodies=bodies,
        joints=tuple(joints),
        ghosts=ghosts,
        sensors=tuple(built.sensors),
        actuators=tuple(built.actuators),
        cameras=built.arrivals.attached("camera", built.cameras),
        lights=built.arrivals.attached("light", built.lights),
        input_devices=tuple(built.devices),
        articulations=forest,
        loops=loops,
        start=start,
        closures=closures,
        rods=rods,
        needles=needles,
        holes=holes,
        arms=arms,
        jaws=find_jaws(bodies, movable, arms),
        diagnostics=tuple(diagnostics),
        roots=built.files.resolver.roots,
    )
