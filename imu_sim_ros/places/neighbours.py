# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that a mesh's file names: materials, textures, buffers; only those in its own folder."""

import re
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import unquote

from imu_sim_ros.core.errors import ImuSimError, InputError, system_error
from imu_sim_ros.inputs.rows import is_present, open_regular
from imu_sim_ros.places.mesh_textures import examine

_NO_PICTURES: Final = (".mtl", ".bin")
_KEYWORDS: Final = {
    ".obj": ("mtllib",),
    ".mtl": ("map_", "bump", "disp", "decal", "refl", "norm"),
}
"""First words of the lines that name a file, by suffix."""
_SHOWN: Final = 100
"""Characters of a name."""


class Neighbours:
    """Reader of the untrusted files that a mesh file names, in its folder or below.

    A name that leaves the folder, by ``..``, as an absolute path or as a URL, stands for the file
    of that name next to the mesh. Links that lie in the folder are followed.
    """

    def __init__(self, path: Path, limit: int) -> None:
        """Initialise for a file, with a limit for all files together."""
        self._path, self._left, self._most = path, limit, limit
        self.lost: list[str] = []
        """Lines about the files that could not be read."""

    def read(self, name: str) -> bytes:
        """Return the content of a file that the mesh names.

        :raises OSError: if it cannot be read; the reason is in :attr:`lost`.
        """
        try:
            return self._read(name)
        except ImuSimError as error:
            self.lost += [line for line in error.problems if line not in self.lost]
            raise OSError(name) from None

    def _read(self, name: str) -> bytes:
        """Return the content of a file that the mesh names, within the limit for all of them."""
        shown = repr(name)[1:-1][:_SHOWN]
        place = self.place(name)
        if place is None:
            escapes = _leaves(name) or _leaves(unquote(name))
            reason = "outside of its folder: put it next to the mesh" if escapes else "not there"
            raise InputError(f"{self._path}: needs {shown}, which is {reason}")
        try:
            with open_regular(place) as file:
                content = file.read(self._left + 1)
        except OSError as error:
            raise system_error(place, error) from None
        self._left -= len(content)
        if self._left < 0:
            raise InputError(
                f"{self._path}: with what it names it is larger than {self._most >> 20} MB: "
                "simplify the mesh, make its textures smaller"
            )
        if place.suffix.lower() not in _NO_PICTURES:
            examine(content, f"{self._path}: the texture {shown}")
        return content

    def place(self, name: str) -> Path | None:
        """Return the file of a name, which in OBJ may have options in front; None: none exists."""
        spellings = [name, unquote(name), *name.split()[-1:]]
        relative = [_posix(word) for word in spellings if not _leaves(word)]
        next_to_it = [PurePosixPath(_posix(word).name) for word in spellings]
        folder = self._path.parent
        places = [
            folder / candidate
            for candidate in (*relative, *next_to_it)
            if candidate.name not in ("", "..")
        ]
        return next(filter(is_present, places), None)


def files_of(path: Path) -> list[Path]:
    """Return a mesh and the files next to it that it names, materials and textures, in order.

    Only those that exist; the mesh is not checked.
    """
    neighbours, paths, queue = Neighbours(path, 0), [path], [path]
    while queue:
        parent = queue.pop()
        for name in _named_files(parent):
            place = neighbours.place(name)
            if place is not None and place not in paths:
                paths.append(place)
                queue.append(place)
    return paths


def _named_files(path: Path) -> list[str]:
    """Return the names of files in a text of glTF, OBJ or MTL; none for other formats."""
    kind = path.suffix.lower()
    if kind not in (".gltf", *_KEYWORDS):
        return []
    text = path.read_text(encoding="utf-8", errors="replace")
    if kind == ".gltf":
        return [name for name in re.findall(r'"uri"\s*:\s*"([^"]+)"', text) if name[:5] != "data:"]
    lines = (line.split(maxsplit=1) for line in text.splitlines())
    return [
        tokens[1] for tokens in lines if len(tokens) == 2 and tokens[0].startswith(_KEYWORDS[kind])
    ]


def _posix(name: str) -> PurePosixPath:
    """Return a name of a mesh file as a path; also one with backslashes."""
    return PurePosixPath(name.strip().replace("\\", "/"))


def _leaves(name: str) -> bool:
    """Return whether a name is an absolute path, a URL, or leads out of the folder."""
    place = _posix(name)
    return (
        place.is_absolute() or ".." in place.parts or any(":" in part for part in place.parts[:1])
    )
