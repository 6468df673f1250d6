"""Types: strict in the package, and wrong words are told before anything runs."""

import os
import re
import subprocess
import sys

import pytest

pytest.importorskip("mypy")


def told(*words):
    run = subprocess.run([sys.executable, "-m", "mypy", "--strict", *words], capture_output=True, text=True)
    return run.returncode, run.stdout


def test_the_package_is_strictly_typed(tmp_path):
    code, out = told("--cache-dir", str(tmp_path), "-p", "genu")
    assert code == 0, out


def test_misuse_is_told_and_right_use_is_not(tmp_path):
    script = os.path.join(os.path.dirname(__file__), "misuse.py")
    with open(script, encoding="utf-8") as file:
        wrong = {number for number, line in enumerate(file, 1) if "# wrong:" in line}
    code, out = told("--cache-dir", str(tmp_path), script)
    found = {int(number) for number in re.findall(r"misuse\.py:(\d+): error", out)}
    assert found == wrong and code == 1, out
    assert len(wrong) == 28
