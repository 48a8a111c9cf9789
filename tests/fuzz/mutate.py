"""Deterministic mutations of a file's bytes."""

from __future__ import annotations

import random
import re

EXTREMES = [
    b"nan", b"inf", b"-inf", b".nan", b"1e400", b"-1", b"0", b"99999999999999999999", b"1e-400", b"''", b"~", b"*a",
    b"&a", b"[", b"]", b"{", b"}", b":", b"- ", b"\t", b"\0", b"\xff\xfe", b"!!python/object:os.system", b"0x7fffffff",
    b"../../../../etc/passwd", b"true", b"<<: *a", b"-2147483649", b"1/2/3/4", b"'\n", b"? ", b"|\n", b"%YAML 9.9\n",
]  # fmt: skip
_TOKEN = re.compile(rb"[^\s]+")


def mutate(data: bytes, rng: random.Random) -> bytes:
    """``data`` after one to four random changes."""
    for _ in range(rng.randint(1, 4)):
        data = rng.choice((_flip, _cut, _double, _replace_token, _insert, _swap_lines, _nest))(data, rng)
    return data[:200_000]


def _flip(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] if rng.random() < 0.5 else data[:start] + data[start + rng.randint(1, 40) :]


def _double(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    end = min(len(data), start + rng.randint(1, 400))
    return data[:end] + data[start:end] * rng.randint(1, 5) + data[end:]


def _replace_token(data: bytes, rng: random.Random) -> bytes:
    tokens = list(_TOKEN.finditer(data))
    if not tokens:
        return rng.choice(EXTREMES)
    token = rng.choice(tokens)
    return data[: token.start()] + rng.choice(EXTREMES) + data[token.end() :]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(EXTREMES) + data[at:]


def _swap_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


def _nest(data: bytes, rng: random.Random) -> bytes:
    depth = rng.choice((5, 80, 2000))
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice((b"[", b"{a: ", b"- ")) * depth + data[at:]
