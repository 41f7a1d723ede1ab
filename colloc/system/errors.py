"""Errors that are meant to be read by the person who stated the problem."""


class CollocError(Exception):
    """Base of the errors colloc raises on purpose; its text is one clear sentence with what to try."""


class ProblemError(CollocError, ValueError):
    """The problem, an option or an input file cannot be used as stated."""


class NotConvergedError(CollocError, RuntimeError):
    """A numerical method stopped without an answer."""


class StoreError(CollocError, OSError):
    """A results file cannot be read or written."""


class ChangedFileWarning(UserWarning):
    """A results file is not as colloc wrote it, and was read all the same."""
