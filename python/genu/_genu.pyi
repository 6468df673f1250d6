from typing import Any, Callable, Optional, Sequence

__version__: str

def call(
    words: Sequence[str],
    failure: Callable[[str, Optional[str], str], BaseException],
    jobs: Optional[int] = None,
    watcher: Optional[Callable[[str, float, str], Any]] = None,
) -> str: ...
def model_file(
    path: str,
    failure: Callable[[str, Optional[str], str], BaseException],
    as_assembled: bool = False,
    source: Optional[str] = None,
) -> str: ...
def main(words: Sequence[str]) -> int: ...
