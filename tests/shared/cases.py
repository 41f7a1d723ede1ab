"""Cases of a test written one a line."""

import colloc


def cases(text, names):
    """Of the lines 'name: field=value, …', with the names of colloc and the given ones."""
    names = {name: getattr(colloc, name) for name in colloc.__all__} | names
    lines = (line.split(": ", 1) for line in text.strip().splitlines())
    return {name: eval(f"dict({fields})", names) for name, fields in lines}
