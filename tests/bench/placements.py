"""From how many placements of the needle the page's help takes it through tissue, and why not from the others.

    python -m tests.bench.placements [--scene needle_insertion] [--seeds 100] [--first 0] [--plan]

Each seed lays the needle elsewhere, turned at random; then the page's buttons are pressed and its slider is pulled, in
this process. ``--plan`` stops at the first plan: whether the needle can be driven as it lies, after being laid down in
another direction, or not at all.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from tests.cockpit.assisted import Page


def outcome(scene: str, seed: int, plan: bool) -> str:
    """What becomes of a throw."""
    page = Page(scene, "PSM2")
    try:
        page.scatters(seed)
        if plan:
            facts, state = page.assist._arms[page.arm], page.simulation.state[0]
            found = page.assist._planners[page.arm].pick(state, facts.base_in_world(state))
            return "out of reach" if found is None else "driven as it lies" if found.drives else "laid down first"
        for word in ("pick", "bring"):
            page.presses(word)
            if page.facts["note"]:
                return f"{word}: {page.facts['note']}"
        page.pulls(1.0)
        return f"{int(page.simulation.state['puncture_count'][0, 0])} punctures {page.facts['note']}".strip()
    except AssertionError as error:
        return f"no end: {error}"
    finally:
        page.simulation.close()


def main() -> int:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="needle_insertion")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--plan", action="store_true")
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    for seed in range(given.first, given.first + given.seeds):
        found = outcome(given.scene, seed, given.plan)
        counts[found] += 1
        sys.stdout.write(f"{seed:4d}  {found}\n")
        sys.stdout.flush()
    for found, count in counts.most_common():
        sys.stdout.write(f"{count:4d} of {given.seeds}: {found}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
