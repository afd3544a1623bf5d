"""The kind of processors for which wheels and images carry code.

That code was made on another machine than it runs on.

Code of one's own processor comes first (`hiproof warm` compiles it); it is 1.05 to 1.1 times as
fast.
"""

from __future__ import annotations

import functools
import platform

import numba
from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

KIND = "x86-64-v3"  # AVX2: Intel since 2013, AMD since 2015
# beyond those of any x86-64 processor with AVX
CPU_FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")


def read_processor() -> str:
    """Return the processor for which code is compiled.

    It is this machine's, or the kind that numba's own variable names.
    """
    return numba.config.CPU_NAME or get_host_cpu_name()


@functools.cache
def runs_kind() -> bool:
    """Return whether this machine's processor is of that KIND.

    It is not where numba's own variables set the processor.
    """
    if numba.config.CPU_NAME or numba.config.CPU_FEATURES or not numba.config.ENABLE_AVX:
        return False
    if platform.machine() not in ("x86_64", "AMD64"):
        return False
    features = get_host_cpu_features()
    return all(features.get(name) for name in CPU_FEATURES)
