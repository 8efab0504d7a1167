"""Damaged files of every format: no crash, no hang, little memory, and one clear error or a whole scene.

200 of each here, always the same; `python tools/fuzz.py` has more.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from fuzz_seeds import FORMATS

pytestmark = pytest.mark.contract

FUZZING = Path(__file__).parents[1] / "helpers" / "fuzzing.py"
COUNT = 200


@pytest.fixture(scope="module")
def outcomes():
    """What became of the files, by format; in one process, whose memory is limited."""
    command = [sys.executable, FUZZING, "all", str(COUNT), "1"]
    few_threads = {"MALLOC_ARENA_MAX": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=os.environ | few_threads, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, f"a crash or a hang: {done.stderr[-3000:]}"
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_are_clear_errors(outcomes, name):
    found = outcomes[name]
    assert not found["faults"], "\n".join(fault for _, fault in found["faults"][:3])
    assert found["files"] == COUNT and found["refused"] > COUNT / 5, "most faults are noticed"
