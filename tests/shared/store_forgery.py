"""Damage to the metadata of an HDF5 file with its own checksums made right again, as a forger would who knows the format."""

import struct

WORD = 0xFFFFFFFF
SUPERBLOCK = 44
"""Bytes of the first block of a file of HDF5 1.8 before its checksum."""
SIGNATURES = (b"OHDR", b"OCHK", b"FRHP", b"FHDB", b"FHIB", b"BTHD", b"BTLF", b"BTIN")
"""First bytes of the blocks that carry checksums: headers of objects, fractal heaps, B-trees."""
LONGEST_BLOCK = 1500
_ROUND = ((4, "acb"), (6, "bac"), (8, "cba"), (16, "acb"), (19, "bac"), (4, "cba"))
_LAST = (("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16), ("a", "c", 4), ("b", "a", 14), ("c", "b", 24))


def turned(word, k):
    return ((word << k) | (word >> (32 - k))) & WORD


def lookup3(data):
    """Bob Jenkins's hash of 2006, the checksum of HDF5's metadata ("Jenkins' lookup3", file format specification 3.0)."""
    v = dict.fromkeys("abc", (0xDEADBEEF + len(data)) & WORD)
    while True:
        part, data = data[:12], data[12:]
        if not part:
            return v["c"]
        for name, word in zip("abc", struct.unpack("<3I", part.ljust(12, b"\0")), strict=True):
            v[name] = (v[name] + word) & WORD
        if not data:
            break
        for k, (x, y, z) in _ROUND:
            v[x] = ((v[x] - v[y]) & WORD) ^ turned(v[y], k)
            v[y] = (v[y] + v[z]) & WORD
    for x, y, k in _LAST:
        v[x] = ((v[x] ^ v[y]) - turned(v[y], k)) & WORD
    return v["c"]


def checked_blocks(data):
    """Begin and end of each block of metadata whose checksum follows it."""
    found = [(0, SUPERBLOCK)]
    for signature in SIGNATURES:
        begin = data.find(signature)
        while begin >= 0:
            for end in range(begin + 8, min(begin + LONGEST_BLOCK, len(data) - 3)):
                if checksum_at(data, end) == lookup3(data[begin:end]):
                    found.append((begin, end))
                    break
            begin = data.find(signature, begin + 1)
    return found


def checksum_at(data, end):
    return struct.unpack_from("<I", data, end)[0]


def forged(rng, data, blocks):
    """The bytes with one to three bytes of one block changed, and its checksum with them."""
    changed = bytearray(data)
    begin, end = blocks[rng.integers(len(blocks))]
    for _ in range(rng.integers(1, 4)):
        where = int(rng.integers(begin + 4, end))
        if rng.integers(2):
            changed[where] ^= 1 << int(rng.integers(8))
        else:
            changed[where] = int(rng.choice([0, 1, 255, rng.integers(256)]))
    struct.pack_into("<I", changed, end, lookup3(bytes(changed[begin:end])))
    return bytes(changed)
