"""Deterministic mutations of a file's bytes: bits, tokens, numbers, lines, cuts, nesting, alias bombs."""

from __future__ import annotations

import random
import re
import struct

MAX_BYTES = 200_000

NUMBERS = [
    b"nan", b"inf", b"-inf", b".nan", b".inf", b"-.inf", b"1e400", b"-1e308", b"1e-320", b"0", b"-0.0", b"-1", b"1e9",
    b"99999999999999999999", b"2147483648", b"-2147483649", b"0x7fffffff", b"0o17", b"1_000", b"1.5.2", b"0,5", b"1" * 5000,
]  # fmt: skip
TOKENS = [
    b"''", b"~", b"*a", b"&a", b"[", b"]", b"{", b"}", b":", b"- ", b"\t", b"\0", b"\xff\xfe", b"\xed\xa0\x80",
    b"!!python/object:os.system", b"!!binary aGk=", b"<<: *a", b"? ", b"|\n", b"%YAML 9.9\n", b"--- ", b"...\n", b"'\n",
    b"../../../../etc/passwd", b"/dev/zero", b"file:///etc/passwd", b"a" * 5000, b"true", b"1/2/3/4", b"//", b"-1//-1",
    b"usemtl", b"mtllib part.obj", b"f 1 2 3 4", b"v", b"\\\n", b"#",
]  # fmt: skip
WORDS = [
    struct.pack("<f", float("nan")), struct.pack("<f", float("inf")), struct.pack("<f", 3e38), struct.pack("<f", 1e-45),
    b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\x06\0\0\0", b"\x05\0\0\0",
]  # fmt: skip
"""Four bytes that a binary format may take for a length, a count or a number."""

_TOKEN = re.compile(rb"[^\s,:\[\]{}]+")
_NUMBER = re.compile(rb"-?\d+(\.\d+)?(e-?\d+)?")


def mutate(data: bytes, rng: random.Random, binary: bool = False, yaml: bool = False) -> bytes:
    """``data`` after one random change, or now and then up to four."""
    changes = [_flip, _cut, _double]
    if binary:
        changes += [_poke, _poke]
    else:
        changes += [_replace_token, _replace_number, _replace_number, _swap_tokens, _insert, _swap_lines]
    if yaml:
        changes += [_nest, _bomb]
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(changes)(data, rng)
    return data[:MAX_BYTES]


def _flip(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
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


def _poke(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(WORDS) + data[at + 4 :]


def _replaced(data: bytes, pattern: re.Pattern[bytes], value: bytes, rng: random.Random) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return value
    token = rng.choice(found)
    return data[: token.start()] + value + data[token.end() :]


def _replace_token(data: bytes, rng: random.Random) -> bytes:
    return _replaced(data, _TOKEN, rng.choice(TOKENS), rng)


def _replace_number(data: bytes, rng: random.Random) -> bytes:
    return _replaced(data, _NUMBER, rng.choice(NUMBERS), rng)


def _swap_tokens(data: bytes, rng: random.Random) -> bytes:
    tokens = list(_TOKEN.finditer(data))
    if len(tokens) < 2:
        return data
    first, second = sorted(rng.sample(tokens, 2), key=lambda token: token.start())
    middle = data[first.end() : second.start()]
    return data[: first.start()] + second.group() + middle + first.group() + data[second.end() :]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(TOKENS + NUMBERS) + data[at:]


def _swap_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


def _nest(data: bytes, rng: random.Random) -> bytes:
    depth = rng.choice((5, 80, 2000))
    opening, closing = rng.choice(((b"[", b"]"), (b"{a: ", b"}"), (b"- ", b"")))
    inside = opening * depth + (closing * depth if rng.random() < 0.5 else b"")
    return _replaced(data, _TOKEN, inside, rng)


def _bomb(data: bytes, rng: random.Random) -> bytes:
    """Lists of aliases of lists of aliases, put before the file and used in it."""
    levels, width = rng.choice(((3, 3), (9, 9), (30, 2)))
    lines = [b"bomb0: &b0 [1, 2, 3]"]
    for level in range(1, levels):
        lines.append(b"bomb%d: &b%d [" % (level, level) + b", ".join([b"*b%d" % (level - 1)] * width) + b"]")
    used = _replaced(data, _TOKEN, b"*b%d" % (levels - 1), rng) if rng.random() < 0.7 else data
    return b"\n".join(lines) + b"\n" + used
