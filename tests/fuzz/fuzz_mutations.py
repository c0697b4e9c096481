"""Damage to a file that knows what files are made of: numbers in text, counts in headers, compressed streams."""

import base64
import gzip
import re
import zlib

import numpy as np

NUMBERS = b"0 -1 1000000000 2147483647 99999999999999999999 nan inf 1e400 x [] null".split()
ENTITIES = (
    b'<!DOCTYPE a [<!ENTITY b "xxxxxxxxxx"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">'
    b'<!ENTITY d SYSTEM "file:///etc/hostname">]>'
)
YAML_BOMB = b"a: &a [x, x, x, x, x, x, x, x, x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (k, k, b", ".join([b"*%c" % (k - 1)] * 9)) for k in range(ord("b"), ord("k"))
)
#: As signed and unsigned numbers of 2, 4 and 8 bytes, in both orders.
COUNTS = [0, 1, 255, 2**15 - 1, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**64 - 1]


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """One to three kinds of damage, inside a compressed stream or outside of it."""
    if content[:2] == b"\x1f\x8b" and random.random() < 0.7:
        inner = damaged(gzip.decompress(content), random)
        bomb = bytes(random.integers(1, 140) << 20) if random.random() < 0.05 else b""
        return gzip.compress(inner + bomb, compresslevel=1, mtime=0)
    if random.random() < 0.02:
        return bytes(random.integers(0, 256, random.integers(0, 400), dtype=np.uint8))
    for _ in range(random.integers(1, 4)):
        content = _DAMAGE[random.integers(len(_DAMAGE))](content, random)
    return content


def _place(content: bytes, random: np.random.Generator) -> int:
    """Anywhere, but half of the time near the beginning, where headers are."""
    n = len(content) + 1
    return int(random.integers(min(n, 400))) if random.random() < 0.5 else int(random.integers(n))


def cut(content: bytes, random: np.random.Generator) -> bytes:
    """Only what is before some byte, or before the end of some line."""
    ends = [match.end() for match in re.finditer(rb"[\n>,]", content)]
    return content[: random.choice(ends)] if ends and random.random() < 0.5 else content[: _place(content, random)]


def flip(content: bytes, random: np.random.Generator) -> bytes:
    """Some bits the other way round."""
    changed = bytearray(content)
    for _ in range(random.integers(1, 6) if content else 0):
        changed[min(_place(content, random), len(changed) - 1)] ^= 1 << int(random.integers(8))
    return bytes(changed)


def count(content: bytes, random: np.random.Generator) -> bytes:
    """A binary number that is giant, zero or negative."""
    width = int(random.choice([2, 4, 8]))
    value = int(COUNTS[random.integers(len(COUNTS))]) % 256**width
    place = _place(content, random)
    order = "little" if random.random() < 0.5 else "big"
    return content[:place] + value.to_bytes(width, order) + content[place + width :]


def field(content: bytes, random: np.random.Generator) -> bytes:
    """A field of an image's header: sizes, kind of number, where the voxels begin, scale, units, codes of the space."""
    if content[344:347] in (b"n+1", b"ni1"):
        place = int(random.choice([40, 42, 44, 46, 48, 70, 72, 76, 80, 108, 112, 116, 122, 252, 254, 280]))
    elif content[:4] == b"\x00\x00\x00\x01":
        place = int(random.choice([4, 8, 12, 16, 20, 24, 28, 30, 34, 42]))
    else:
        return count(content, random)
    value = int(COUNTS[random.integers(len(COUNTS))]) % 65536 if random.random() < 0.5 else int(random.integers(3000))
    order = "little" if content[:1] == b"\x5c" else "big"
    return content[:place] + value.to_bytes(2, order) + content[place + 2 :]


def number(content: bytes, random: np.random.Generator) -> bytes:
    """A number in text that is giant, negative, no number, or none."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", content[: 1 << 16]))
    if not found:
        return content
    one = found[random.integers(len(found))]
    return content[: one.start()] + NUMBERS[random.integers(len(NUMBERS))] + content[one.end() :]


def swap(content: bytes, random: np.random.Generator) -> bytes:
    """A part of the file in the other byte order."""
    start = _place(content, random)
    stop = start + 4 * int(random.integers(1, 50))
    part = np.frombuffer(content[start : start + (len(content[start:stop]) // 4) * 4], "<u4")
    return content[:start] + part.byteswap().tobytes() + content[start + part.nbytes :]


def lines(content: bytes, random: np.random.Generator) -> bytes:
    """A line that is missing, twice there, or moved."""
    parts = content.splitlines(keepends=True)
    k = int(random.integers(len(parts))) if parts else 0
    again = parts[k : k + 1] * int(random.integers(0, 3))
    return b"".join(parts[:k] + again + parts[k + 1 :])


def header(content: bytes, random: np.random.Generator) -> bytes:
    """The JSON of a safetensors file changed, and its length with it."""
    length = int.from_bytes(content[:8], "little")
    if not 0 < length < len(content) or content[8:9] != b"{":
        return number(content, random)
    changed = number(content[8 : 8 + length], random)
    return len(changed).to_bytes(8, "little") + changed + content[8 + length :]


def xml(content: bytes, random: np.random.Generator) -> bytes:
    """Entities, and arrays that unpack to far more than they declare."""
    if b"<Data>" not in content:
        return lines(content, random)
    if random.random() < 0.5:
        head, _, rest = content.partition(b"?>")
        return head + b"?>" + ENTITIES + rest.replace(b"<Value>", b"<Value>&c;&d;", 1)
    bomb = base64.b64encode(zlib.compress(bytes(random.integers(1, 140) << 20), 1))
    return re.sub(rb"<Data>.*?</Data>", b"<Data>" + bomb + b"</Data>", content, count=1, flags=re.DOTALL)


def nested(content: bytes, random: np.random.Generator) -> bytes:
    """Brackets in brackets, or aliases of aliases, where a configuration or a record is expected."""
    if content[:1] in (b"\x00", b"\xff"):
        return flip(content, random)
    place = _place(content, random)
    return [b"[" * 5000, YAML_BOMB, content[:place] + b"[" * 2000 + content[place:]][random.integers(3)]


_DAMAGE = (cut, cut, flip, flip, count, count, field, field, number, number, number, swap, lines, header, xml, nested)
