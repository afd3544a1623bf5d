"""One tile: the bundled neighbourhood, as `hiproof reconstruct` runs it.

Then it shows the worst building.
"""

import sys
from pathlib import Path

from hiproof import Request, read_parameters, reconstruct_area
from hiproof.simulate import demo_files

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
files = demo_files()
request = Request((str(files["cloud"]),), out, str(files["footprints"]), restart=True)
summary = reconstruct_area(request)
print(f"{summary.buildings} buildings: {summary.by_status}, roof types {summary.by_type}")

buildings = read_parameters(out / "parameters.jsonl")
shares = {b["id"]: b["residuals"]["share_within_20cm"] for b in buildings}
# null: too few points to tell
worst = min((id for id in shares if shares[id] is not None), key=shares.get)
print(
    f"worst: {worst}, {100 * shares[worst]:.0f} % of its points inside the outline within 0.2 m of "
    "the roof"
)
