"""Prints the steps of a Dockerfile as tab-separated lines, for `bare_image.sh`: instruction, then its text on one line.

Instructions that this reader does not know are an error, so that no step is silently left out.
"""

import json
import re
import sys
from pathlib import Path

KNOWN = {"FROM", "RUN", "COPY", "USER", "WORKDIR", "ENV", "ENTRYPOINT", "CMD"}


def steps(text: str) -> list[tuple[str, str]]:
    """Instructions and their texts; lines continued by a backslash are joined, exec forms become plain words."""
    joined = re.sub(r"\\\n\s*", "", text)
    found = []
    for line in joined.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        name, _, rest = line.partition(" ")
        if name not in KNOWN:
            raise SystemExit(f"Dockerfile: instruction '{name}' is unknown to {Path(__file__).name}")
        found.append((name, " ".join(json.loads(rest)) if rest.startswith("[") else rest.strip()))
    return found


if __name__ == "__main__":
    for name, rest in steps(Path(sys.argv[1]).read_text("utf-8")):
        print(name, rest, sep="\t")
