"""Odd values for every control and every order of the page, counted: ``python -m tests.fuzz.controls [EACH]``.

Values come from lists of odd ones, from mutations of their text, and one in three is what a person could send, so that
acceptance is counted too. A control keeps a value that a person could have chosen, or the run ends with status 1.
"""

from __future__ import annotations

import json
import random
import sys
from collections import Counter
from typing import Any

from ligature.cockpit.address import Address
from ligature.cockpit.gate import Gate
from ligature.cockpit.intake import acceptable, placeable
from ligature.cockpit.orders import HELP, MODES, ORDERS, PHASES, read_order
from ligature.cockpit.page import serve

from tests.cockpit import test_hands, test_intake

USUAL: dict[str, Any] = {
    "hello": lambda r: "a" * r.randint(1, 40), "move": lambda r: [r.uniform(-1, 1) for _ in range(7)],
    "speed": lambda r: r.choice(list(MODES)), "drag": lambda r: [r.choice(PHASES), r.uniform(-1, 1), r.uniform(-1, 1)],
    "assist": lambda r: r.choice(HELP), "drive": lambda r: r.random(),
    "view": lambda r: [r.random() < 0.5, r.randint(0, 480), r.random() < 0.5], "dark": lambda r: r.random() < 0.5,
}  # fmt: skip
"""What a page sends; the other orders have no value."""

SOUND: dict[str, Any] = {
    "slider": lambda v: isinstance(v, int | float) and -1.0 <= v <= 1.0, "steps": lambda v: v in test_intake.OPTIONS,
    "choice": lambda v: v in test_intake.OPTIONS, "text": lambda v: isinstance(v, str) and len(v) <= 200,
    "flag": lambda v: type(v) is bool, "button": lambda v: type(v) is bool,
}  # fmt: skip


def orders(each: int, rng: random.Random) -> dict[str, Counter[str]]:
    """Outcomes by the word of an order."""
    found: dict[str, Counter[str]] = {}
    for word in ORDERS:
        count = found[f"order {word}"] = Counter()
        for _ in range(each):
            usual = rng.random() < 1 / 3
            value = USUAL.get(word, lambda _: None)(rng) if usual else rng.choice(test_hands.ODD)
            text = json.dumps({"do": word, "value": value})
            if not usual and rng.random() < 0.3:
                at = rng.randrange(len(text))
                text = text[:at] + rng.choice('[]{},:"0e\x00') + text[at + rng.randint(0, 2) :]
            order = read_order(text)
            assert order is None or test_hands.sound(order), text[:200]
            count["rejected" if order is None else "taken"] += 1
    return found


def controls(each: int, rng: random.Random) -> dict[str, Counter[str]]:
    """Outcomes by the kind of a control, and of the gizmo."""
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""))
    found: dict[str, Counter[str]] = {}
    try:
        for name, control in test_intake.controls(server).items():
            count = found[f"control {name}"] = Counter()
            for _ in range(each):
                keys = rng.sample(test_intake.PROPERTIES, rng.randint(1, 2))
                updates = {key: rng.choice(test_intake.ODD) for key in keys}
                taken = acceptable(control, updates)
                assert not taken or SOUND[name](updates["value"]), updates
                count["taken" if taken else "rejected"] += 1
        count = found["gizmo"] = Counter()
        for _ in range(each):
            place, turn = ([rng.choice((*test_intake.ODD, 0.1, 0.5)) for _ in range(n)] for n in (3, 4))
            usual = rng.random() < 1 / 3
            taken = placeable([0.1, 0.2, 0.3] if usual else place, [1.0, 0.0, 0.0, 0.0] if usual else turn)
            count["taken" if taken else "rejected"] += 1
    finally:
        server.stop()
    return found


def main() -> None:
    """Print a row for each."""
    each, rng = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000, random.Random(11)
    for name, count in {**orders(each, rng), **controls(each, rng)}.items():
        sys.stdout.write(f"| {name} | {sum(count.values())} | {count['taken']} | {count['rejected']} |\n")


if __name__ == "__main__":
    main()
