"""What stops a command, as exceptions: the sentence of the command, and its parts."""

from __future__ import annotations

import os
from typing import Any, Optional

# File, row and column, as far as they are known.
Place = tuple[Optional[str], Optional[int], Optional[str]]


def in_file(path: Any, row: Optional[int] = None) -> Place:
    """A file, or a row of it."""
    return os.fspath(path), row, None


class GenuError(Exception):
    """Why a command cannot go on, in one sentence: which file, what was expected, what to do.

    Attributes
    ----------
    file : str or None
        The file at fault; ``"trials"`` and so on where a table was given from memory.
    row : int or None
        Its line, counted from 1.
    column : str or None
        Its column: a name of a table's header, or a number.
    stage : str or None
        The stage of a build that stopped, such as ``"register"``.
    """

    def __init__(self, message: str, *, stage: Optional[str] = None, place: Place = (None, None, None), table: Optional[str] = None) -> None:
        super().__init__(message)
        self.stage = stage
        self.table = table
        self.file, self.row, self.column = place


class StageError(GenuError):
    """A stage of a build cannot go on; ``stage`` names it."""


class InputError(GenuError):
    """A file is not there, or what it holds is at fault."""


class MachineError(GenuError, OSError):
    """The machine does not give what is needed: a full disk, a folder that may not be written, a lock that another build holds."""


class OptionError(GenuError, ValueError):
    """An option in specimen.toml or in an options file is wrong."""


class UsageError(GenuError, ValueError):
    """The call itself is wrong: an unknown stage, option, ligament or method."""


_KINDS = {"stage": StageError, "file": InputError, "machine": MachineError, "option": OptionError, "usage": UsageError}


def made(kind: str, stage: Optional[str], message: str, place: Place = (None, None, None), table: Optional[str] = None) -> GenuError:
    """The exception of a failure that the program tells."""
    return _KINDS.get(kind, GenuError)(message, stage=stage, place=place, table=table)
