"""Record the results of `test_recorded_results` anew, and say which changed.

python -m tests.recorded.record
"""

import json

from tests.recorded.digest import assert_same, digest
from tests.recorded.test_recorded_results import CASES, KNOWN, known


def main() -> None:
    before = known() if KNOWN.exists() else {}
    found = {name: digest(case()) for name, (case, _, _) in CASES.items()}
    for name, (_, precision, floor) in CASES.items():
        try:
            assert_same(found[name], before[name], precision, floor)
        except KeyError:
            print(f"new: {name}")
        except AssertionError as error:
            print(f"changed: {name}: {str(error).splitlines()[0][:200]}")
        else:
            found[name] = before[name]
    lines = (
        f"{json.dumps(name)}: {json.dumps(digests)}" for name, digests in sorted(found.items())
    )
    KNOWN.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
