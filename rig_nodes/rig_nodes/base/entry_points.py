# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Things that are found by their names: one module each of a package here, and what other installed packages add by entry points.

Verbs, parts, formats, rigs and controllers are found by it. To ask for entry points takes some milliseconds, so it is done only
where a name is none of ours, or where all are listed.
"""

from __future__ import annotations

import sys
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path

from .errors import RigError

TYPE_CHECKING = False  # as in typing, whose import would cost time that help does not need
if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from typing import Any


class Group:
    """All things of a kind, by their names.

    Attributes
    ----------
    group : str
        Name of their group in the metadata of other packages, e.g. ``rig_nodes.parts``.
    what : str
        What one of them is, for the errors' sentences.

    Parameters
    ----------
    name : str
        End of the group's name.
    what : str
        As above.
    package : str
        The package of ours that has a module for each; empty where ours are no modules.
    mark : str
        The name that such a module, and no other of the package, sets at its top level.
    """

    def __init__(self, name: str, what: str, package: str = "", mark: str = "") -> None:
        self.group, self.what, self._package, self._mark = f"rig_nodes.{name}", what, package, mark

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Names of ours, sorted."""
        folder = Path(str(sys.modules[self._package].__file__)).parent
        return tuple(sorted(path.stem for path in folder.glob("*.py") if _sets(path, self._mark)))

    def has_own(self, name: str) -> bool:
        """Return whether one of ours has this name; only its own file is read."""
        folder = Path(str(sys.modules[self._package].__file__)).parent
        return name.isidentifier() and _sets(folder / f"{name}.py", self._mark)

    def own_module(self, name: str) -> Any:
        """Return the module of one of ours."""
        return import_module(f"{self._package}.{name}")

    def added(self) -> dict[str, EntryPoint]:
        """Return the entry points of other packages by their names, sorted."""
        from importlib.metadata import entry_points

        return {point.name: point for point in sorted(entry_points(group=self.group), key=lambda point: point.name)}

    def names(self) -> list[str]:
        """Return the names of ours, then those of other packages."""
        return [*self.own, *(name for name in self.added() if name not in self.own)]

    def load(self, point: EntryPoint, kind: type = object) -> Any:
        """Load what another package adds.

        Parameters
        ----------
        point : EntryPoint
            Its entry point.
        kind : type
            What it has to be.

        Returns
        -------
        object
            What the entry point names.

        Raises
        ------
        RigError
            When it cannot be loaded or is something else; the sentence names the package.
        """
        try:
            found = point.load()
        except (Exception, SystemExit) as error:  # what another package's code raises when it is imported
            raise self.refused(point, f"cannot be loaded ({type(error).__name__}: {error})") from None
        if not isinstance(found, kind):
            raise self.refused(point, f"is of type {type(found).__name__}, expected {kind.__name__}")
        return found

    def folder(self, point: EntryPoint, file: str) -> Path:
        """Return the folder of the package that an entry point names.

        Parameters
        ----------
        point : EntryPoint
            The entry point; its value is a package of Python, which need not have an __init__.py, with the name of the entry point.
        file : str
            A file that the folder must have.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        RigError
            When there is no such folder; the sentence names the package.
        """
        from importlib.util import find_spec

        try:
            spec = find_spec(point.value)
        except (Exception, SystemExit) as error:  # what another package's code raises when it is imported
            raise self.refused(point, f"cannot be found ({type(error).__name__}: {error})") from None
        places = [Path(place) for place in (spec.submodule_search_locations or ())] if spec else []
        found = next((place for place in places if (place / file).is_file()), None)
        if found is None or found.name != point.name:
            raise self.refused(point, f"is no folder '{point.name}' with a {file}")
        return found

    def refused(self, point: EntryPoint, why: str) -> RigError:
        """Return the error on what another package adds; ``why`` is the end of its sentence."""
        package = f"{point.dist.name} {point.dist.version}" if point.dist else "of an unknown name"
        return RigError(f"{self.what} '{point.name}' of the package {package}: {point.value} {why}; mend or uninstall that package")


@cache
def _sets(path: Path, mark: str) -> bool:
    """Return whether a module sets a name at its top level."""
    return path.is_file() and f"\n{mark} = " in path.read_text(encoding="utf-8")
