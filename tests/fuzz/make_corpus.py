"""Write every damaged input of these tests into a folder, to try commands on by hand:

    PYTHONPATH=tests python tests/fuzz/make_corpus.py FOLDER [SEED]

`corpus.json` in it names each file and what must be said of it. The same seed makes the same bytes.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from fuzz.damaged_clouds import damaged_clouds
from fuzz.damaged_footprints import ODD, write_beside_a_sound_one
from fuzz.damaged_models import RECORDS, damaged_files, damaged_models, invalid_models
from tiny_town import make_town, write_town

NAMED = "expected .* got"  # what every sentence about a file that cannot be used has in it


def make_corpus(folder: Path, seed: int = 0) -> dict[str, str]:
    """Write the corpus; by path in `folder`, what is said (a regular expression) or the status that
    must come of it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_town(folder, make_town(2, 3.0))  # sound, to run the damaged ones beside
    results = {
        str(case.path.relative_to(folder)): case.sentence
        for case in damaged_clouds(folder / "clouds", seed)
    }
    for kind, contents in (
        (
            "models",
            damaged_files(folder / "sound")
            | damaged_models(folder / "sound")
            | invalid_models(folder / "sound"),
        ),
        ("records", RECORDS),
    ):
        (folder / kind).mkdir(exist_ok=True)
        for name, content in contents.items():
            path = (
                folder / kind / (file_name(name) + (".city.jsonl" if kind == "models" else ".json"))
            )
            path.write_bytes(content)
            results[str(path.relative_to(folder))] = NAMED
    (folder / "footprints").mkdir(exist_ok=True)
    for name, (ring, status) in ODD.items():
        path = write_beside_a_sound_one(folder / "footprints" / f"{file_name(name)}.geojson", ring)
        results[str(path.relative_to(folder))] = status
    (folder / "corpus.json").write_text(json.dumps(results, indent=1) + "\n")
    return results


def file_name(name: str) -> str:
    return re.sub(r"[^\w.+-]", "_", name)


if __name__ == "__main__":
    print(
        f"{len(make_corpus(Path(sys.argv[1]), int((*sys.argv, '0')[2])))} damaged inputs in "
        f"{sys.argv[1]}"
    )
