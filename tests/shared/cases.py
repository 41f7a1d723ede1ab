"""Cases of a test written one a line."""

import pytest

import colloc


def cases(text, names):
    """Of the lines 'name: field=value, …', with the names of colloc and the given ones."""
    names = {name: getattr(colloc, name) for name in colloc.__all__} | names
    lines = (line.split(": ", 1) for line in text.strip().splitlines())
    return {name: eval(f"dict({fields})", names) for name, fields in lines}


def slow_but(kept, every):
    """Parameters of a test of which only the kept ones run by default."""
    return [one if one in kept else slow(one) for one in every]


def slow(case, **how):
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=pytest.mark.slow, **how)
