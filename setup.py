"""The compiled kernel (colloc/mechanics/native), a plain library that knows nothing of Python.
Without it NumPy serves."""

import hashlib
from pathlib import Path

from setuptools import Extension, setup

native = Path("colloc/mechanics/native")
files = sorted(native.glob("*.[ch]"))
digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
kernel = Extension(
    "colloc.mechanics._kernel",
    [str(native / "kernel.c")],
    depends=[str(file) for file in files],
    define_macros=[("COLLOC_SOURCES", digest)],
    extra_compile_args=(native / "flags.txt").read_text().split(),
    py_limited_api=True,
    optional=True,
)
setup(ext_modules=[kernel])
