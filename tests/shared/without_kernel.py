"""The NumPy solvers, which the compiled kernel is compared with."""

from contextlib import contextmanager
from unittest.mock import patch

from colloc.mechanics import native_kernel


@contextmanager
def numpy_instead():
    """A context in which NumPy does everything, on all threads."""
    with patch.object(native_kernel, "library", lambda: None):
        yield
