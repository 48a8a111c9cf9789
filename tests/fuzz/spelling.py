"""The same YAML document in other hands: order of keys, flow and block, quotes, numbers, comments, anchors, line ends.

`spelled` writes nested dicts, lists and scalars so that a reader with yaml-cpp's rules (as AMBF reads its files) finds
them unchanged. Text N is the same in every run.
"""

from __future__ import annotations

import random
from typing import Any

WORDS = {True: ("true", "True", "TRUE", "yes", "Yes", "on", "ON", "y", "Y"),
         False: ("false", "False", "FALSE", "no", "No", "off", "OFF", "n", "N")}  # fmt: skip
NULLS = ("", "~", "null", "Null", "NULL")
COMMENTS = ("# Größe: 3 mm", "#", "# {not: [a, value", "#---", "# name: 'x", "# end\t")
RUBBISH = ("[1, 2", "oops", "{}", "nan")


def spelled(document: dict[str, Any], number: int) -> str:
    """``document`` in the style ``number``."""
    return _Hand(number).text(document)


class _Hand:
    """One author's habits."""

    def __init__(self, number: int) -> None:
        self.rng = rng = random.Random(number)
        self.indent = rng.choice((1, 2, 2, 3, 4, 8))
        self.list_indent = rng.choice((0, self.indent))
        self.flow = rng.choice((0.0, 0.3, 0.8, 1.0))
        self.shuffle = rng.random() < 0.5
        self.quote = rng.choice((0.0, 0.0, 0.2, 1.0))
        self.comment = rng.choice((0.0, 0.0, 0.2))
        self.alias = rng.choice((0.0, 0.5, 1.0))
        self.duplicate = rng.choice((0.0, 0.0, 0.1))
        self.tag = rng.choice((0.0, 0.0, 0.1))
        self.newline = rng.choice(("\n", "\n", "\r\n", "\r"))
        self.lax = rng.random() < 0.3
        self.anchors: dict[str, str] = {}

    def text(self, document: dict[str, Any]) -> str:
        rng = self.rng
        head = rng.choice(("", "", "---\n", "%YAML 1.1\n---\n", "# AMBF Version: (0.1)\n", "\n\n", "--- # scene\n"))
        body = self._block_map(document, 0)
        tail = rng.choice(("", "", "...\n", "---\nother: document\n", "\n\n  \n", "# end"))
        text = head + body + tail
        if not tail and rng.random() < 0.3:
            text = text.rstrip("\n")
        return rng.choice(("", "", "\ufeff")) + text.replace("\n", self.newline)

    # --- collections ------------------------------------------------------------------------

    def _entries(self, block: dict[str, Any]) -> list[tuple[str, Any]]:
        entries = list(block.items())
        if self.shuffle:
            self.rng.shuffle(entries)
        return entries

    def _block_map(self, block: dict[str, Any], depth: int) -> str:
        lines = ""
        pad = " " * depth
        for key, value in self._entries(block):
            lines += self._remark(pad)
            lines += f"{pad}{self._key(key)}:{self._value(value, depth)}"
            if self.rng.random() < self.duplicate:
                lines += f"{pad}{self._key(key)}: {self.rng.choice(('oops', '{}', '1e400', '[1]'))}\n"
        return lines

    def _value(self, value: Any, depth: int) -> str:
        """What follows ``key:`` or ``-``, with the end of the line."""
        rng = self.rng
        mark, known = self._anchor(value)
        if known:
            return f" *{known}{self._trail()}\n"
        if isinstance(value, dict | list) and value and rng.random() >= self.flow:
            inner = depth + (self.list_indent if isinstance(value, list) else self.indent)
            text = self._block_list(value, inner) if isinstance(value, list) else self._block_map(value, inner)
            return f"{mark}{self._trail()}\n{text}"
        if isinstance(value, dict | list):
            return f"{mark} {self._flow(value, depth)}{self._trail()}\n"
        return f"{mark} {self._scalar(value)}{self._trail()}\n"

    def _block_list(self, items: list[Any], depth: int) -> str:
        pad = " " * depth
        lines = ""
        for item in items:
            lines += self._remark(pad)
            if isinstance(item, dict | list) and item:
                lines += f"{pad}- {self._flow(item, depth)}{self._trail()}\n"
            else:
                lines += f"{pad}-{self._value(item, depth)}"
        return lines

    def _flow(self, value: Any, depth: int) -> str:
        rng = self.rng
        if isinstance(value, dict):
            parts = []
            for k, v in self._entries(value):
                mark, known = self._anchor(v)
                gap = rng.choice((" ", " ", "  ", "\t"))
                parts.append(
                    f"{self._key(k)}:{gap}" + (f"*{known} " if known else f"{mark.strip()} {self._flow(v, depth)}")
                )
            return self._joined("{", parts, "}", depth)
        if isinstance(value, list):
            return self._joined("[", [self._flow(v, depth) for v in value], "]", depth)
        return self._scalar(value, flow=True)

    def _joined(self, start: str, parts: list[str], end: str, depth: int) -> str:
        rng = self.rng
        if parts and rng.random() < 0.2:
            inner = "\n" + ("" if self.lax else " " * (depth + 1 + rng.randint(0, 6)))
            last = rng.choice(("", ","))
            return start + inner + f",{inner}".join(parts) + last + inner + end
        gap = rng.choice(("", "", " "))
        return start + gap + rng.choice((", ", ", ", " , ", ",\t")).join(parts) + gap + end

    def _anchor(self, value: Any) -> tuple[str, str]:
        """An anchor to write before ``value``, and the name it has if it stands elsewhere already."""
        if not self.alias or self.rng.random() >= self.alias or not isinstance(value, dict | float):
            return "", ""
        key = repr(value)
        if key in self.anchors:
            return "", self.anchors[key]
        self.anchors[key] = name = f"{self.rng.choice(('a', 'box-geometry', 'größe.x', 'x_1'))}{len(self.anchors)}"
        return f" &{name}", ""

    # --- scalars ----------------------------------------------------------------------------

    def _key(self, key: str) -> str:
        rng = self.rng
        if rng.random() < self.quote * 0.3 or not _plain(key):
            return rng.choice((f"'{key}'", f'"{key}"')) if "'" not in key and "\\" not in key else _double(key, rng)
        return key

    def _scalar(self, value: Any, flow: bool = False) -> str:
        rng = self.rng
        if isinstance(value, bool):
            return self._quoted(rng.choice(WORDS[value]))
        if value is None:
            return rng.choice(NULLS[1:] if flow else NULLS)
        if isinstance(value, float):
            return self._quoted(_float(value, rng))
        if isinstance(value, int):
            return self._quoted(rng.choice((str(value), hex(value) if value >= 0 else str(value))))
        assert isinstance(value, str)
        if value == "" or not _plain(value):
            return _double(value, rng)
        return self._quoted(value)

    def _quoted(self, text: str) -> str:
        rng = self.rng
        if rng.random() < self.tag:
            return f"!!str {text}" if _plain(text) else f"! '{text}'"
        if rng.random() >= self.quote:
            return text
        return f"'{text}'" if rng.random() < 0.5 else _double(text, rng)

    def _trail(self) -> str:
        rng = self.rng
        if rng.random() < self.comment:
            return rng.choice((" ", "  ", "\t")) + rng.choice(COMMENTS)
        return rng.choice(("", "", "", " ", "\t") if self.comment else ("",))

    def _remark(self, pad: str) -> str:
        if self.rng.random() >= self.comment:
            return ""
        remark = self.rng.choice(COMMENTS)
        return self.rng.choice(
            (
                "\n",
                f"{pad}{remark}\n",
                "   \n",
                f"{remark}\n",
                "\t\n",
                f"{pad}\t \n",
                f"\t{remark}\n",
                f"{pad}\t{remark}\n",
            )
        )


def _plain(text: str) -> bool:
    """Whether ``text`` may stand without quotes."""
    special = set(":#,[]{}&*!|>'\"%@`?\\\n\t")
    return bool(text) and text == text.strip() and not special & set(text) and text[0] != "-" and text not in NULLS


def _double(text: str, rng: random.Random) -> str:
    out = ""
    for character in text:
        if character in '"\\':
            out += "\\" + character
        elif ord(character) > 126 or character < " " or rng.random() < 0.02:
            out += f"\\u{ord(character):04x}" if ord(character) < 0x10000 else f"\\U{ord(character):08x}"
        else:
            out += character
    return f'"{out}"'


def _float(value: float, rng: random.Random) -> str:
    text = repr(value)
    forms = [text]
    if value == int(value) and abs(value) < 1e15:
        forms += [str(int(value)), f"{int(value)}.", f"{value:.3f}"]
    if 0 < abs(value) < 1 and "e" not in text:
        forms.append(text.replace("0.", ".", 1))
    if "e" in text:
        forms.append(text.upper())
    shift = f"{value!r}e0" if "e" not in text else text
    forms += [shift, shift.replace("e", "E"), shift.replace("e0", "e+00")]
    if value > 0:
        forms.append(f"+{text}")
    return rng.choice(forms)
