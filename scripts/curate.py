"""Copy new results into results/curated and note what made them: python -m scripts.curate [folder
of results]

`results/curated/manifest.json` is the list: of each file or folder the command that makes it, the
commit that last changed it, and versions. What lies in the folder of results under the same name is
copied, and what has changed is noted. A file that is `archived` is not made any more: its command
is one of the commit given there. A new file needs a line with its command first.
"""

import json
import shutil
import subprocess
from pathlib import Path

from colloc.system.environment import versions
from scripts.program import command_line

CURATED = Path("results/curated")


def last_change(path: Path) -> str:
    """The commit that last changed a file or folder."""
    log = ["git", "log", "-1", "--format=%H", "--", str(path)]
    return subprocess.run(log, capture_output=True, text=True, check=True).stdout.strip()


def main() -> None:
    source = command_line(__doc__, ("source", Path("results"))).source
    manifest = CURATED / "manifest.json"
    entries = json.loads(manifest.read_text(encoding="utf-8"))
    for name, entry in entries.items():
        if (source / name).is_file() and "archived" not in entry:
            shutil.copyfile(source / name, CURATED / name)
        if entry["commit"] != (written := last_change(CURATED / name)):
            entry |= {"commit": written, "versions": versions()}
    manifest.write_text(json.dumps(entries, indent=1, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
