"""Calls of the program: words of a command line, progress, Ctrl-C."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Callable, Iterator, Mapping, Optional, Sequence

from genu import _errors, _genu

if TYPE_CHECKING:
    from genu._types import Place, Progress

Watcher = Callable[[str, float, str], Any]
# Files in memory, by the paths at which the program finds them.
Files = dict[str, bytes]


def run(*words: Any, jobs: Optional[int] = None, progress: Progress = None) -> str:
    """Run a command line of ``build-model`` in this process.

    Python's lock is not held meanwhile, and calls from several threads do not disturb each other. Ctrl-C stops the
    work between two steps and raises KeyboardInterrupt; what was finished is kept, and the same call goes on from there.

    Parameters
    ----------
    *words : str or path-like
        The words after ``build-model``, such as ``"inspect", "knee", "--json"``.
    jobs : int, optional
        Number of threads; all where None. Results do not depend on it.
    progress : callable, True or None
        Called as ``progress(stage, share, message)`` with the share done, 0 to 1; the last call has 1. True draws a
        bar (by tqdm where it is installed). An exception it raises stops this call's work and no other.

    Returns
    -------
    str
        What the command prints.

    Raises
    ------
    GenuError
        One of its kinds, with the command's sentence.
    """
    return called(words, {}, jobs=jobs, progress=progress)


def called(words: Sequence[Any], files: Files, *, jobs: Optional[int] = None, progress: Progress = None) -> str:
    """:func:`run` with files in memory."""
    with watching(progress) as watcher:
        return _genu.call(spoken(words), _errors.made, (jobs, watcher), files)


def spoken(words: Sequence[Any]) -> list[str]:
    """The words as text."""
    return [os.fspath(w) if hasattr(w, "__fspath__") else str(w) for w in words]


@contextmanager
def watching(progress: Progress) -> Iterator[Optional[Watcher]]:
    """The callback of ``progress``; a bar where it is True."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        with _bar() as watcher:
            yield watcher
    elif callable(progress):
        yield progress
    else:
        raise TypeError("progress: a callable, True or None was expected")


@contextmanager
def _bar() -> Iterator[Watcher]:
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped,import-not-found,unused-ignore]
    except ImportError:
        def line(stage: str, share: float, message: str) -> None:
            print(f"{100 * share:3.0f} %  {stage}: {message}", file=sys.stderr)

        yield line
        return
    with tqdm(total=100, bar_format="{l_bar}{bar}| {elapsed}") as bar:
        def watcher(stage: str, share: float, message: str) -> None:
            bar.set_description(f"{stage}: {message}", refresh=False)
            bar.n = round(100 * share, 1)
            bar.refresh()

        yield watcher


def absolute(place: Place) -> str:
    """The path, or the folder of what has one, so that no word of it is taken for a verb or an option."""
    if isinstance(place, (str, os.PathLike)):
        return os.path.abspath(os.fspath(place))
    folder = getattr(place, "folder", None)
    if not isinstance(folder, str):
        raise TypeError(f"a path, or what has a folder (a build), was expected, not {type(place).__name__}")
    return os.path.abspath(folder)


def names(given: Any) -> list[str]:
    """Names as a list; a text is one name and not its letters."""
    return [given] if isinstance(given, str) else [str(name) for name in given]


def settings(options: Optional[Mapping[str, Any]], *stages: str) -> list[str]:
    """``--set`` for every option; ``{"hexmesh": {"edge_length_mm": 0.75}}`` or ``{"hexmesh.edge_length_mm": 0.75}``.

    A key that names none of the stages is an option of the first of them; without stages every key names its own.
    """
    words: list[str] = []
    for key, value in (options or {}).items():
        path = key if not stages or key.split(".")[0] in stages else f"{stages[0]}.{key}"
        if "." not in path and isinstance(value, Mapping):
            for inner, one in value.items():
                words += ["--set", f"{path}.{inner}={toml(one)}"]
        else:
            words += ["--set", f"{path}={toml(value)}"]
    return words


def toml(value: Any) -> str:
    """A value in TOML's words."""
    if hasattr(value, "tolist"):  # numpy
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    raise TypeError(f"a value cannot be {type(value).__name__}: a number, text, bool, list or dict was expected")


def toml_text(table: Mapping[str, Any]) -> str:
    """A file of TOML, a line a key."""
    return "".join(f"{key} = {toml(value)}\n" for key, value in table.items())


def wanted(module: str, extra: str) -> Any:
    """An optional package, or a sentence that tells how to get it."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f'{module} is needed here and not installed: in a clone, pip install "./python[{extra}]"') from error


def as_html(title: str, rows: Mapping[str, Any]) -> str:
    """A small table of HTML, as notebooks show an object."""
    from html import escape

    cells = "".join(f"<tr><th style='text-align:left'>{escape(k)}</th><td>{escape(str(v))}</td></tr>" for k, v in rows.items())
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"
