"""What stops a command, as exceptions: the sentence of the command, and its parts."""

from __future__ import annotations

import re
from typing import Optional

_ROW = re.compile(r"\b(?:line|row)\s+(\d+)\b")
# A path stands in front of what is wrong with it, after "cannot read" or the stage's name.
_FILE = re.compile(r"(?:^|cannot (?:read|write) |names |\s)((?:[A-Za-z]:)?[^\s:,;\"']*\.[A-Za-z][A-Za-z0-9.]{0,8})(?=$|[\s:,;\"'])")


class GenuError(Exception):
    """Why a command cannot go on, in one sentence: which file, what was expected, what to do.

    Attributes
    ----------
    file : str or None
        The file at fault, as the sentence names it.
    row : int or None
        Its line, counted from 1.
    stage : str or None
        The stage of a build that stopped, such as ``"register"``.
    """

    def __init__(self, message: str, *, stage: Optional[str] = None) -> None:
        super().__init__(message)
        self.stage = stage
        said = message[len(stage) + 2 :] if stage and message.startswith(f"{stage}: ") else message
        found = _FILE.search(said)
        self.file: Optional[str] = found.group(1) if found else None
        row = _ROW.search(said)
        self.row: Optional[int] = int(row.group(1)) if row else None


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


def made(kind: str, stage: Optional[str], message: str) -> GenuError:
    """The exception of a failure that the program tells."""
    return _KINDS.get(kind, GenuError)(message, stage=stage)
