"""What one test does to its process is no matter of the others."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from .apart import ended

HERE = Path(__file__).parent
STRAY = """
import os, signal
import pytest

@pytest.fixture
def before():
    raise KeyboardInterrupt

@pytest.fixture
def after():
    yield
    raise KeyboardInterrupt

def test_interrupted(): raise KeyboardInterrupt
def test_signal(): os.kill(os.getpid(), signal.SIGINT)
def test_before(before): pass
def test_after(after): pass
def test_neither(): pass
"""
APART = """
import os, signal, sys
import pytest

def process(): return os.environ.setdefault("FIRST", str(os.getpid()))

@pytest.mark.parametrize("how", ["odd [one]::", "killed", "wrong"])
@pytest.mark.apart
def test_apart(how, tmp_path, pytestconfig):
    assert process() == os.environ["FIRST"]
    if how == "killed":
        os.kill(0, signal.SIGKILL)
    assert how != "wrong", "it is said why"

@pytest.mark.apart
def test_left_out(): pytest.skip("for a reason")

def test_other(): assert "FIRST" not in os.environ
"""


def what_pytest_says(folder: Path, text: str, *options: str) -> str:
    """What pytest says of these tests, among those that it finds here."""
    (folder / "tests").mkdir()
    for name in ("conftest.py", "apart.py"):
        shutil.copy(HERE / name, folder / "tests")
    (folder / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\n")
    (folder / "tests" / "test_these.py").write_text(text)
    done = ended("-m", "pytest", "-q", "-rfEs", "-p", "no:randomly", *options, cwd=folder)
    return done.stdout + done.stderr


def test_an_interruption_in_a_worker_fails_the_test_it_hits_and_no_other(tmp_path: Path) -> None:
    """Nor those apart, which are begun after it."""
    said = what_pytest_says(tmp_path, STRAY + APART, "-n", "1")
    assert re.search(r"^4 failed, 4 passed, 1 skipped, 2 errors in", said, flags=re.MULTILINE), said
    assert said.count("an interruption from elsewhere") >= 4
    # what a test apart does to its process is its own
    assert "test_apart[killed]" in said
    assert "it is said why" in said
    assert "for a reason" in said
