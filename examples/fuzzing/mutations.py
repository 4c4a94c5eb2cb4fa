"""Ways to damage a file: bytes, numbers, words, lines, cells of tables, elements of XML, keys of JSON, columns of Parquet."""

from __future__ import annotations

import copy
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import pyarrow as pa
import pyarrow.parquet

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]+")
EXTREMES = (
    *("0", "-0.0", "1", "-1", "2", "1e-9", "-1e-300", "1e-320", "1e12", "-1e12", "1e160", "1e300", "-1e300", "1e400"),
    *(
        "nan",
        "-nan",
        "inf",
        "-inf",
        "",
        " ",
        "9" * 40,
        "9" * 5000,
        "-999",
        "65535",
        "4294967296",
        "9223372036854775808",
    ),
    *(
        "0x10",
        "1_000",
        "1,5",
        "1.2.3",
        "--1",
        "true",
        "null",
        "None",
        "[]",
        "{}",
        "[1, 2]",
        "'",
        '"',
        '"x"',
        "\\",
        "#",
        "%s",
    ),
    *(
        "\x00",
        "\u0663",
        "\u00e9\u202e",
        "\ufeff",
        "\U0001f600",
        "a" * 300,
        "b" * 1_000_000,
        "../../etc",
        "1979-05-27",
        "1 2",
    ),
)
VALUES: tuple[Any, ...] = (
    *(
        None,
        True,
        False,
        0,
        -1,
        1e300,
        -1e-300,
        1e12,
        10**30,
        10**400,
        float("nan"),
        float("inf"),
        "",
        "x" * 300,
        "\u00e9",
    ),
    *([], {}, [[]], [0.0, 0.0, 0.0], {"a": 1}, ["a"], -0.0),
)
DEEP = (
    "[" * 5000,
    "{" * 5000,
    '{"a":' * 5000,
    "<a>" * 5000,
    "<link>" * 20000 + "</link>" * 20000,
    "a = " + "[" * 3000,
    "(" * 9999,
)
ENTITIES = (
    '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;">]>'
)
UNFIT = (
    ValueError,
    LookupError,
    TypeError,
    ArithmeticError,
    RecursionError,
    OSError,
    ElementTree.ParseError,
    pa.ArrowException,
)
"""What a change raises of content that is no longer of its kind."""


def mutate(content: bytes, suffix: str, rng: Random) -> bytes:
    """Damage the bytes of a file in one to three ways that its kind can have."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kinds = [_bytes] if rng.random() < 0.15 else [*_OF.get(suffix, ()), _text]
        change = rng.choice(kinds)
        try:
            content = change(content, rng)
        except (
            ValueError,
            LookupError,
            TypeError,
            ArithmeticError,
            RecursionError,
            ElementTree.ParseError,
            pa.ArrowException,
            OSError,
        ):
            content = _bytes(content, rng)  # no longer of its kind, by an earlier change
    return content


def mutate_file(file: Path, rng: Random) -> None:
    """Damage a file in place."""
    file.write_bytes(mutate(file.read_bytes(), file.suffix, rng))


# ------------------------------------------------------------------------------------------------------ any bytes


def _bytes(content: bytes, rng: Random) -> bytes:
    data, at = bytearray(content), rng.randrange(len(content) + 1)
    end = min(len(data), at + rng.choice((1, 4, 64, 4096)))
    kind = rng.randrange(9)
    if kind <= 2:
        for place in rng.sample(range(len(data)), min(len(data), rng.choice((1, 1, 3, 30)))):
            data[place] ^= 1 << rng.randrange(8) if kind else rng.randrange(1, 256)
    elif kind == 3:
        del data[at:]
    elif kind == 4:
        del data[at:end]
    elif kind == 5:
        data[at:at] = data[at:end]
    elif kind == 6:
        data[at:end] = rng.randbytes(rng.choice((1, 8, 200)))
    elif kind == 7:
        return rng.choice(
            (b"", b"\n", b"\xef\xbb\xbf" + content, content + content, b"\x00" * 100, content[::-1], b"\n\n" + content)
        )
    else:
        text = content.decode("utf-8", "replace")
        return rng.choice(
            (text.encode("utf-16"), text.encode("utf-8-sig"), text.replace("\n", "\r").encode("utf-8", "replace"))
        )
    return bytes(data)


# ------------------------------------------------------------------------------------------------------- any text


def _text(content: bytes, rng: Random) -> bytes:
    text = content.decode("utf-8", "surrogateescape")
    return rng.choice((_number, _number, _number, _word, _line, _deep))(text, rng).encode("utf-8", "surrogateescape")


def _number(text: str, rng: Random) -> str:
    """One number, or all in a stretch, by an extreme."""
    found = list(NUMBER.finditer(text))
    if not found:
        raise ValueError("no numbers")
    first = rng.randrange(len(found))
    extreme = rng.choice(EXTREMES)
    for match in reversed(found[first : first + rng.choice((1, 1, 1, 2, 12, 10**6))]):
        by = extreme if rng.random() < 0.5 else _near(match[0], rng)
        text = text[: match.start()] + by + text[match.end() :]
    return text


def _near(number: str, rng: Random) -> str:
    """A number that looks sound: a little off, of the other sign, in another unit."""
    value = float(number)
    return rng.choice(
        ("-" + number.lstrip("+-"), number + "e3", repr(value * 1.001), repr(value + 0.01), repr(value * 0.5))
    )


def _word(text: str, rng: Random) -> str:
    """A word by another of the file, or by an extreme, or none; or two words exchanged."""
    found = list(WORD.finditer(text))
    if not found:
        raise ValueError("no words")
    one, two = sorted((rng.choice(found), rng.choice(found)), key=lambda match: match.start())
    kind = rng.randrange(4)
    if kind == 0 and one.end() <= two.start():
        return text[: one.start()] + two[0] + text[one.end() : two.start()] + one[0] + text[two.end() :]
    by = (two[0], rng.choice(EXTREMES), one[0] + rng.choice("s1\u00e9 \n"), "")[kind]
    return text[: one.start()] + by + text[one.end() :]


def _line(text: str, rng: Random) -> str:
    lines = text.split("\n")
    one, two = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(7)
    if kind == 0:
        lines.insert(one, lines[two])
    elif kind == 1:
        del lines[one]
    elif kind == 2:
        lines[one], lines[two] = lines[two], lines[one]
    elif kind == 3:
        lines.insert(one, lines[0])
    elif kind == 4:
        lines = lines[: rng.randrange(len(lines)) + 1]
    elif kind == 5:
        lines[one] = lines[one] * rng.choice((2, 50, 20000))
    else:
        lines[one] = ""
    return "\n".join(lines)


def _deep(text: str, rng: Random) -> str:
    at = rng.choice((0, len(text), rng.randrange(len(text) + 1)))
    return text[:at] + rng.choice(DEEP) + text[at:]


# --------------------------------------------------------------------------------------------------------- tables


def _table(content: bytes, rng: Random) -> bytes:
    rows = [line.split(",") for line in content.decode("utf-8").splitlines() if line]
    column, row = rng.randrange(len(rows[0])), rng.randrange(len(rows))
    other = rng.randrange(len(rows[0]))
    kind = rng.randrange(11)
    if kind == 0:
        rows[row][column] = _near(rows[-1][column], rng) if rng.random() < 0.5 else rng.choice(EXTREMES)
    elif kind == 1:  # a column constant
        extreme = rng.choice((*EXTREMES, rows[-1][column]))
        rows[1:] = [[*r[:column], extreme, *r[column + 1 :]] for r in rows[1:]]
    elif kind == 2:  # columns exchanged, or one under two names
        rows[0][column] = rows[0][other]
        if rng.random() < 0.7:
            rows[0][other] = content.decode("utf-8").splitlines()[0].split(",")[column]
    elif kind == 3:
        rows = [[*r[:column], *r[column + 1 :]] for r in rows]
    elif kind == 4:
        rows = [[*r, r[column]] for r in rows]
        rows[0][-1] = rng.choice((rows[0][column], "extra", "session", "payload", "approach1", "fx", "", "q9", "time"))
    elif kind == 5:  # every row the same, but for its id
        rows[1:] = [[r[0], *rows[1][1:]] for r in rows[1:]]
    elif kind == 6:
        rows = [rows[0], *(r for r in rows[1:] for _ in range(rng.choice((2, 10))))]
    elif kind == 7:
        rows = rows[: rng.choice((1, 2, 3, 8, 9, 10, 16, 20))]
    elif kind == 8:  # ids shared
        rows[1:] = [[str(i // rng.choice((2, 7))), *r[1:]] for i, r in enumerate(rows[1:])]
    elif kind == 9:
        factor = rng.choice((1000.0, -1.0, 0.0, 1e-9, 1.001, 1e12, 1e150, 1e300))
        rows[1:] = [[*r[:column], repr(float(r[column]) * factor), *r[column + 1 :]] for r in rows[1:]]
    else:
        body = rows[1:]
        rng.shuffle(body)
        rows[1:] = body
    return ("\n".join(",".join(r) for r in rows) + "\n").encode("utf-8")


def _parquet(content: bytes, rng: Random) -> bytes:
    table = pa.parquet.read_table(io.BytesIO(content))
    index = rng.randrange(table.num_columns)
    name, values = table.column_names[index], table.column(index).to_pylist()
    kind = rng.randrange(5)
    if kind == 0:
        table = table.rename_columns(
            [rng.choice(EXTREMES) if i == index else n for i, n in enumerate(table.column_names)]
        )
    elif kind == 1:
        table = table.remove_column(index)
    elif kind == 2:
        table = table.append_column(rng.choice((name, "extra", "session", "__index_level_0__")), table.column(index))
    elif kind == 3:
        table = table.set_column(index, name, pa.nulls(table.num_rows))
    else:
        odd = rng.choice(([1], {"a": 1}, b"\xff", "x", True, 10**18, 1e300, float("nan"), -999.0))
        replaced = [odd] * len(values) if rng.random() < 0.5 else [*values[:-1], type(values[0])(odd)]
        table = table.set_column(index, name, pa.array(replaced))
    written = io.BytesIO()
    pa.parquet.write_table(table, written)
    return written.getvalue()


# --------------------------------------------------------------------------------------------------- trees of keys


def _xml(content: bytes, rng: Random) -> bytes:
    root = ElementTree.fromstring(content)
    elements = list(root.iter())
    parents = {child: parent for parent in elements for child in parent}
    one, two = rng.choice(elements), rng.choice(elements)
    kind = rng.randrange(8)
    if kind == 0 and one in parents:
        parents[one].remove(one)
    elif kind == 1:
        two.append(copy.deepcopy(one))
    elif kind == 2 and one in parents and two in parents and two not in one.iter():
        parents[one].remove(one)
        parents[two].append(one)
    elif kind == 3:
        one.tag = two.tag
    elif kind == 4:
        root.extend(copy.deepcopy(one) for _ in range(rng.choice((2, 3000))))
    elif kind == 5:
        text = content.decode("utf-8")
        return (
            ENTITIES + re.sub(r'(xyz|name|rpy)="[^"]*"', r'\1="&c;"', re.sub(r"^<\?.*?\?>", "", text), count=1)
        ).encode()
    else:
        named = [element for element in elements if element.attrib]
        one, two = rng.choice(named), rng.choice(named)
        key, other = rng.choice(sorted(one.attrib)), rng.choice(sorted(two.attrib))
        if kind == 6:
            one.attrib[key], two.attrib[other] = two.attrib[other], one.attrib[key]
        elif rng.random() < 0.3:
            del one.attrib[key]
        else:
            words = one.attrib[key].split(" ")
            words[rng.randrange(len(words))] = rng.choice(EXTREMES).replace("\x00", "0")
            one.attrib[key] = " ".join(words)
    return ElementTree.tostring(root)


def _json(content: bytes, rng: Random) -> bytes:
    tree = json.loads(content)
    nodes: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
        for key in keys:
            nodes.append((node, key))
            walk(node[key])

    walk(tree)
    shallow = [(node, key) for node, key in nodes if isinstance(key, str)]
    (one, key), (two, other) = (rng.choice(shallow if rng.random() < 0.6 else nodes) for _ in range(2))
    kind = rng.randrange(5)
    if kind == 0:
        del one[key]
    elif kind == 1:
        one[key] = copy.deepcopy(two[other])
    elif kind == 2 and isinstance(one[key], list):
        one[key] = one[key] * rng.choice((0, 2)) if rng.random() < 0.5 else one[key][:-1]
    elif kind == 3 and isinstance(one, dict):
        one[rng.choice(("x", "schema", "q", "site"))] = one.pop(key)
    else:
        value = one[key]
        numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
        one[key] = (
            value * rng.choice((-1, 1e3, 1e300, 1e-300, 0)) if numeric and rng.random() < 0.4 else rng.choice(VALUES)
        )
    return json.dumps(tree).encode("utf-8", "surrogatepass")


def _toml(content: bytes, rng: Random) -> bytes:
    lines = content.decode("utf-8").split("\n")
    keyed = [i for i, line in enumerate(lines) if "=" in line]
    at = rng.choice(keyed)
    key = lines[at].split("=")[0]
    value = rng.choice(
        (*EXTREMES, "-inf", "[inf, 0, 0]", "[1e300, 1e300, 1e300]", "[0.0, 0.0, 0.0]", "{a = 1}", "[[1], [2]]", "'x'")
    )
    lines[at] = f"{rng.choice((key, key, key, 'x ', 'a.b '))}= {value}"
    return "\n".join(lines).encode("utf-8")


_OF: dict[str, tuple[Callable[[bytes, Random], bytes], ...]] = {
    ".csv": (_table, _table),
    ".parquet": (_parquet, _bytes, _bytes),
    ".urdf": (_xml, _xml),
    ".json": (_json, _json, _json),
    ".toml": (_toml, _toml),
}
