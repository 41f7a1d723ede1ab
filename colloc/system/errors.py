"""Errors and warnings written for the person who stated the problem."""


class CollocError(Exception):
    """Base of the errors colloc raises on purpose; its text is one clear sentence with what to try.

    Examples
    --------
    >>> import colloc
    >>> try:
    ...     colloc.load_problem("nowhere.py")
    ... except colloc.CollocError as error:
    ...     print(error)
    there is no problem file nowhere.py.
    """

    def __str__(self) -> str:
        # control characters made visible: the text may quote files of others
        return "".join(
            c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in super().__str__()
        )


class ProblemError(CollocError, ValueError):
    """The problem, an option or an input file cannot be used as stated.

    Examples
    --------
    >>> import colloc
    >>> colloc.Problem("x", joint_limit=4)
    Traceback (most recent call last):
    colloc.system.errors.ProblemError: joint_limit must lie in (0, pi], not 4.
    """


class NotConvergedError(CollocError, RuntimeError):
    """A numerical method stopped without an answer. Solves do not raise it: their status says so.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("x")
    >>> colloc.Starts(problem, ()).solution()
    Traceback (most recent call last):
    colloc.system.errors.NotConvergedError: none of 0 starts of x was verified.
    """


class StoreError(CollocError, OSError):
    """A results file cannot be read or written. It is caught like any other trouble with a file.

    Examples
    --------
    >>> import colloc
    >>> issubclass(colloc.StoreError, OSError)
    True
    """


class ReadOnlyRunWarning(UserWarning):
    """A file that saves work cannot be read or written; the work goes on without it."""


class OrderWarning(UserWarning):
    """Coefficients that differ were given by position, in an order on which texts disagree."""


class SlowWarning(UserWarning):
    """Something is computed more slowly than it could be."""
