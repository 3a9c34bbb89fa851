"""Files in the user's cache: named by their content, written once, and few enough for a bound on their bytes.

Of a folder with more bytes, the files that were used longest ago go first. Several processes may share a folder.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

from tightloop.errors import SceneError
from tightloop.whole_files import whole_file

_MB = 1 << 20
#: Most bytes of each folder.
LIMITS = {"height_fields": 2048 * _MB, "mujoco": 1024 * _MB, "scenes": 64 * _MB}
#: What stays of a full folder, so that not every new file removes another one [-].
_STAYS = 0.875
#: Age at which a hidden file is what a killed process left [s].
_MAKING_SECONDS = 3600.0


def keep(kind: str, name: str, write: Callable[[Path], object]) -> Path:
    """Write a file to a folder of the user's cache, unless it is there, and return it.

    It stays while it is used more recently than others, because recordings and running daemons refer to it.

    Args:
        kind: The folder, one of `LIMITS`.
        name: Name of the file, which stands for its content.
        write: Writes the content to a path.

    Raises:
        SceneError: The file cannot be written.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(home) / "tightloop" / kind
    path = folder / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            # it was used now; another process may have removed it
            os.utime(path)
        except FileNotFoundError:
            with whole_file(path) as part:
                write(part)
            _trim(folder, LIMITS[kind], path)
        except OSError:
            # one that can only be read serves as well
            if not path.is_file():
                raise
    except OSError as error:
        raise SceneError(f"{path}: cannot be kept there: {error}; set XDG_CACHE_HOME to a folder") from error
    return path


def _trim(folder: Path, limit: int, kept: Path) -> None:
    """Remove the files used longest ago, but not ``kept``, while a folder has more bytes than its limit."""
    found = []
    with os.scandir(folder) as entries:
        for entry in entries:
            try:
                status = entry.stat(follow_symlinks=False)
            except FileNotFoundError:
                # another process removed it
                continue
            # another process may still write what is hidden
            in_the_making = entry.name.startswith(".") and status.st_mtime > time.time() - _MAKING_SECONDS
            if entry.is_file(follow_symlinks=False) and not in_the_making:
                found.append((status.st_mtime_ns, status.st_size, entry.path))
    total = sum(size for _, size, _ in found)
    if total <= limit:
        return
    for _, size, path in sorted(found):
        if total <= _STAYS * limit:
            return
        if path != str(kept):
            Path(path).unlink(missing_ok=True)
            total -= size
