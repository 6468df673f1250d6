"""What stops a command, as exceptions: the sentence of the command, and its parts."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import Any, Iterator, Mapping, Optional

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
    code : str or None
        The kind of fault in one word, as in the JSON of an error: ``"stage"``, ``"file"``, ``"machine"``, ``"option"``, ``"usage"``.
    key, value : str or None
        The option and its value at fault, where the program tells them apart from the sentence.
    advice : str or None
        What the kind of fault asks for; None where the module itself found the fault.
    """

    code: Optional[str] = None

    def __init__(self, message: str, *, stage: Optional[str] = None, place: Place = (None, None, None), table: Optional[str] = None) -> None:
        super().__init__(message)
        self.stage = stage
        self.table = table
        self.file, self.row, self.column = place
        self.key: Optional[str] = None
        self.value: Optional[str] = None
        self.advice: Optional[str] = None


class StageError(GenuError):
    """A stage of a build cannot go on; ``stage`` names it."""

    code = "stage"


class InputError(GenuError):
    """A file is not there, or what it holds is at fault."""

    code = "file"


class MachineError(GenuError, OSError):
    """The machine does not give what is needed: a full disk, a folder that may not be written, a lock that another build holds."""

    code = "machine"


@contextmanager
def writing(place: str) -> Iterator[None]:
    """What the machine refuses while a file or folder at ``place`` is written, as a MachineError."""
    try:
        yield
    except GenuError:
        raise
    except OSError as error:
        words = f"cannot write {place}: {error.strerror or error}; see to the disk and the rights, and call again"
        told = MachineError(words, place=in_file(place))
        told.errno = error.errno
        raise told from None


class OptionError(GenuError, ValueError):
    """An option in specimen.toml or of the call is wrong."""

    code = "option"


class UsageError(GenuError, ValueError):
    """The call itself is wrong: an unknown stage, option, ligament or method."""

    code = "usage"


_KINDS = {"stage": StageError, "file": InputError, "machine": MachineError, "option": OptionError, "usage": UsageError}


def made(
    kind: str,
    stage: Optional[str],
    message: str,
    place: Place = (None, None, None),
    table: Optional[str] = None,
    more: Optional[Mapping[str, Optional[str]]] = None,
) -> GenuError:
    """The exception of a failure that the program tells; ``more`` has ``key``, ``value``, ``advice`` as far as the program knows them."""
    error = _KINDS.get(kind, GenuError)(message, stage=stage, place=place, table=table)
    error.code = kind
    for name in ("key", "value", "advice"):
        if more and more.get(name) is not None:
            setattr(error, name, more[name])
    return error
