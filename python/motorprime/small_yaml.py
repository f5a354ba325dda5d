"""A strict reader for the small part of YAML in which ROS writes calibrations.

Nested mappings, flow lists and mappings over any number of lines, block lists of scalars, comments.
Whatever else YAML offers (anchors, tags, block texts, lists of mappings) is an error that names the line,
never a guess.
"""

from __future__ import annotations

import re
from typing import TypeAlias, Union

from .errors import ArgumentError

Value: TypeAlias = Union[str, int, float, bool, "list[Value]", "dict[str, Value]", None]

_KEY = re.compile(r"([A-Za-z_][\w./-]*|\"[^\"\\]*\"|'[^']*')\s*:(?:\s+|$)")
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_TOKEN = re.compile(r"\s*(\"[^\"\\]*\"|'[^']*'|[\[\]{},]|:(?=\s|$)|(?:[^\s\[\]{},:]|:(?=\S))+)")
_WORDS: dict[str, Value] = {"true": True, "false": False, "null": None, "~": None, "": None}
_UNSUPPORTED = tuple("&*!|>%@`\"'?")


def parse(text: str) -> dict[str, Value]:
    """Return the first document of ``text``, which must be a mapping.

    Raises :class:`ArgumentError` that names the line.
    """
    return _Reader(text).document()


class _Reader:
    def __init__(self, text: str) -> None:
        # (line number, indentation, content) of every line that has content
        self.lines: list[tuple[int, int, str]] = []
        self.next = 0
        for number, raw in enumerate(text.splitlines(), 1):
            line = _without_comment(raw).rstrip()
            if not line or (line.startswith("%") and not self.lines):
                continue
            if line in ("---", "..."):
                if self.lines:
                    break
                continue
            content = line.lstrip(" ")
            if content.startswith("\t"):
                raise _error(number, "expected spaces for indentation, got a tab")
            self.lines.append((number, len(line) - len(content), content))

    def document(self) -> dict[str, Value]:
        if not self.lines:
            raise ArgumentError("expected a YAML mapping, got nothing")
        mapping = self.mapping(self.lines[0][1])
        if self.next < len(self.lines):
            raise _error(self.lines[self.next][0], "the indentation does not fit")
        return mapping

    def mapping(self, indent: int) -> dict[str, Value]:
        """Read the keys at this indentation."""
        result: dict[str, Value] = {}
        while self.next < len(self.lines):
            number, depth, content = self.lines[self.next]
            if depth != indent:
                break
            match = _KEY.match(content)
            if match is None:
                raise _error(number, f"expected 'key: value', got {content!r}")
            key = match.group(1).strip("\"'")
            if key in result:
                raise _error(number, f"the key {key} appears twice")
            self.next += 1
            result[key] = self.value(number, indent, content[match.end() :])
        return result

    def value(self, number: int, indent: int, rest: str) -> Value:
        """Read what follows a key: a scalar, a flow collection or an indented block."""
        if rest.startswith(("[", "{")):
            return self.flow(number, rest)
        if rest:
            return _scalar(number, rest)
        if self.next == len(self.lines):
            return None
        _, depth, content = self.lines[self.next]
        # YAML lets the items of a list stand at the indentation of its key.
        if depth >= indent and re.match(r"-(\s|$)", content):
            return self.block_list(depth)
        return self.mapping(depth) if depth > indent else None

    def block_list(self, indent: int) -> list[Value]:
        items: list[Value] = []
        while self.next < len(self.lines):
            number, depth, content = self.lines[self.next]
            match = re.match(r"-(?:\s+|$)", content)
            if depth != indent or match is None:
                break
            self.next += 1
            rest = content[match.end() :]
            if _KEY.match(rest) or re.match(r"-(\s|$)", rest):
                raise _error(number, "lists of mappings or of lists are not supported")
            items.append(self.flow(number, rest) if rest.startswith(("[", "{")) else _scalar(number, rest))
        return items

    def flow(self, number: int, rest: str) -> Value:
        """Read [...] or {...}, over as many lines as it takes."""
        tokens = _tokens(number, rest)
        while not _balanced(tokens):
            if self.next == len(self.lines):
                raise _error(number, f"the bracket {tokens[0]} is not closed")
            line, _, content = self.lines[self.next]
            self.next += 1
            tokens += _tokens(line, content)
        value, end = _flow(number, tokens, 0)
        if end != len(tokens):
            raise _error(number, f"unexpected {tokens[end]!r} after a closing bracket")
        return value


def _flow(number: int, tokens: list[str], at: int) -> tuple[Value, int]:
    """Read the value at ``tokens[at]``; return it and the index after it."""
    opening = tokens[at]
    if opening not in "[{":
        if opening in "]},:":
            raise _error(number, f"unexpected {opening!r}")
        return _scalar(number, opening), at + 1
    at += 1
    items: list[Value] = []
    mapping: dict[str, Value] = {}
    closing = "]" if opening == "[" else "}"
    while tokens[at] != closing:
        if opening == "{":
            key = tokens[at].strip("\"'")
            if tokens[at + 1 : at + 2] != [":"] or key in mapping:
                raise _error(number, f"expected a new 'key: value' in braces, got {key!r}")
            mapping[key], at = _flow(number, tokens, at + 2)
        else:
            item, at = _flow(number, tokens, at)
            items.append(item)
        if tokens[at] == ",":
            at += 1
        elif tokens[at] != closing:
            raise _error(number, f"expected ',' or {closing!r}, got {tokens[at]!r}")
    return (items if opening == "[" else mapping), at + 1


def _tokens(number: int, text: str) -> list[str]:
    tokens: list[str] = []
    at = 0
    while at < len(text.rstrip()):
        match = _TOKEN.match(text, at)
        if match is None:
            raise _error(number, f"unexpected {text[at:].strip()!r}")
        tokens.append(match.group(1))
        at = match.end()
    return tokens


def _balanced(tokens: list[str]) -> bool:
    return sum(t in ("[", "{") for t in tokens) <= sum(t in ("]", "}") for t in tokens)


def _scalar(number: int, text: str) -> Value:
    if len(text) >= 2 and text[0] in "\"'" and text[0] == text[-1] and text[0] not in text[1:-1]:
        return text[1:-1]
    if text.startswith(_UNSUPPORTED) or ": " in text or text.endswith(":"):
        raise _error(number, f"this part of YAML is not supported: {text!r}")
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if text.lower() in (".nan", ".inf", "-.inf", "+.inf"):
        return float(text.replace(".", "", 1))
    return _WORDS.get(text.lower(), text)


def _without_comment(line: str) -> str:
    """Cut '# ...' at the start of the line or after a space, outside quotes."""
    quote = ""
    for i, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and (i == 0 or line[i - 1] in " [{,:"):
            quote = letter
        elif letter == "#" and (i == 0 or line[i - 1] in " \t"):
            return line[:i]
    return line


def _error(number: int, message: str) -> ArgumentError:
    return ArgumentError(f"line {number}: {message}")
