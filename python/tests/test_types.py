"""Types: strict in the package, and wrong words are told before anything runs."""

import ast
import importlib.util
import os
import re
import subprocess
import sys

import genu
import pytest

SCRIPT = os.path.join(os.path.dirname(__file__), "misuse.py")


def told(module, *words):
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    run = subprocess.run([sys.executable, "-m", module, *words], capture_output=True, text=True)
    return run.returncode, run.stdout


def wrong():
    with open(SCRIPT, encoding="utf-8") as file:
        return {number for number, line in enumerate(file, 1) if "# wrong:" in line}


def test_checkers_know_every_name_of_the_package():
    # what genu imports on its first use, checkers read in a stub
    with open(os.path.join(os.path.dirname(genu.__file__), "__init__.pyi"), encoding="utf-8") as file:
        body = ast.parse(file.read()).body
    named = {alias.asname for part in body if isinstance(part, ast.ImportFrom) for alias in part.names}
    named |= {part.target.id for part in body if isinstance(part, ast.AnnAssign)}
    assert named == set(genu.__all__)


def test_the_package_is_strictly_typed(tmp_path):
    code, out = told("mypy", "--strict", "--cache-dir", str(tmp_path), "-p", "genu")
    assert code == 0, out


def test_misuse_is_told_and_right_use_is_not(tmp_path):
    code, out = told("mypy", "--strict", "--cache-dir", str(tmp_path), SCRIPT)
    found = {int(number) for number in re.findall(r"misuse\.py:(\d+): error", out)}
    assert found == wrong() and code == 1, out
    assert len(found) == 39


def test_pyright_tells_the_same():
    code, out = told("pyright", "--pythonpath", sys.executable, SCRIPT)
    found = {int(number) for number in re.findall(r"misuse\.py:(\d+):\d+ - error", out)}
    assert found == wrong() and code == 1, out
