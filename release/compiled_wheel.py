"""A wheel that carries hiproof's compiled code, made of one that does not.

python release/compiled_wheel.py dist/hiproof-1.0.0-py3-none-any.whl dist

The code is for this Python, for processors of the kind in `hiproof.compiled.kinds` and for the
versions of numba, llvmlite and NumPy that are installed here with hiproof. The wheel's extra
`compiled` pins these versions; beside others its code is passed over, and the first run compiles as
ever. It is tagged as numba's own wheel: where that runs, the code does.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import distribution, version
from pathlib import Path

from hiproof.compiled.kinds import KIND
from hiproof.compiled.stamp import VERSIONS

WARM = ("-m", "hiproof", "warm", "--all")


def compiled_wheel(wheel: Path, out: Path, command: Sequence[str] = WARM) -> Path:
    """Write a wheel with compiled code, and return its path.

    `command`, arguments of Python, compiles the code of its package.
    """
    with tempfile.TemporaryDirectory() as folder:
        find_python("-m", "wheel", "unpack", str(wheel), "--dest", folder)
        (root,) = Path(folder).iterdir()
        compile_in(root, command)
        describe(root)
        old_wheels = set(out.glob("*.whl"))
        find_python("-m", "wheel", "pack", str(root), "--dest-dir", str(out))
    (wheel_made,) = set(out.glob("*.whl")) - old_wheels
    return wheel_made


def compile_in(root: Path, command: Sequence[str]) -> None:
    """Have the code of the packages in `root` compiled and kept beside their sources."""
    environment = {
        name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"
    } | {
        "NUMBA_CPU_NAME": KIND,
        "NUMBA_CPU_FEATURES": "",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")]),
    }
    subprocess.run([sys.executable, *command], check=True, cwd=root, env=environment)
    if not any(root.rglob("*.nbc")):
        raise SystemExit(f"expected compiled code beside the sources in {root}, got none")


def describe(root: Path) -> None:
    """Write into a wheel which Pythons, systems and versions it is for.

    Its code fits these versions.
    """
    (info,) = root.glob("*.dist-info")
    kind = info / "WHEEL"
    code_files = [
        line
        for line in kind.read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("Tag:")
    ]
    of_numba = (distribution("numba").read_text("WHEEL") or "").splitlines()
    tags = [line for line in of_numba if line.startswith("Tag:")]
    kind.write_text("\n".join([*code_files, *tags, ""]), encoding="utf-8")
    described = info / "METADATA"
    head, _, text = described.read_text(encoding="utf-8").partition("\n\n")
    pins = [f"Requires-Dist: {name}=={version(name)}; extra == 'compiled'" for name in VERSIONS]
    described.write_text(
        "\n".join([head.rstrip(), "Provides-Extra: compiled", *pins, "", text]), encoding="utf-8"
    )


def find_python(*arguments: str) -> None:
    subprocess.run([sys.executable, *arguments], check=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("wheel", type=Path, help="a wheel without compiled code")
    parser.add_argument("out", type=Path, help="the folder for the new one")
    asked = parser.parse_args()
    print(compiled_wheel(asked.wheel.resolve(), asked.out.resolve()))
