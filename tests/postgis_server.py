"""A PostgreSQL with PostGIS of the tests' own: a new cluster in a temporary folder, reached through
its socket alone.
"""

import os
import shutil
import subprocess
import tempfile
from contextlib import contextmanager
from pathlib import Path


def programs() -> Path | None:
    """Folder of initdb and postgres, None where PostgreSQL is not installed."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    result = shutil.which("initdb")
    return next(
        (
            f
            for f in [*folders, *([Path(result).parent] if result else [])]
            if (f / "postgres").exists()
        ),
        None,
    )


def explain_absence() -> str | None:
    """The reason why no server can be started here, None where it can."""
    if programs() is None:
        return (
            "PostgreSQL is not installed (Debian: apt-get install postgresql "
            "postgresql-15-postgis-3)"
        )
    extension = list(Path("/usr/share/postgresql").glob("*/extension/postgis.control"))
    return (
        None
        if extension
        else "PostGIS is not installed (Debian: apt-get install postgresql-15-postgis-3)"
    )


@contextmanager
def running():
    """Yield the address of a fresh database; everything is gone afterwards."""
    folder = Path(tempfile.mkdtemp(prefix="hiproof-pg-"))
    # PostgreSQL refuses to run as root: the superuser lends it to the user that its package made
    as_user = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    if as_user:
        shutil.chown(folder, "postgres")
    data, binaries = folder / "data", programs()

    def call(program: str, *arguments: str) -> None:
        command = [*as_user, str(binaries / program), *arguments]
        subprocess.run(
            command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder
        )

    call("initdb", "-D", str(data), "-U", "tester", "--auth=trust", "--no-sync")
    options = f"-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
    call("pg_ctl", "-D", str(data), "-o", options, "-w", "-l", str(folder / "log"), "start")
    try:
        yield f"postgresql://tester@/postgres?host={folder}"
    finally:
        call("pg_ctl", "-D", str(data), "-m", "immediate", "stop")
        shutil.rmtree(folder, ignore_errors=True)
