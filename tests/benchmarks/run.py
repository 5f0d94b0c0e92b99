"""Measure time and memory beside what a user would use instead: one line for every ratio."""

import sys
from pathlib import Path

import pytest

if __name__ == "__main__":
    arguments = ["-m", "benchmark", "-q", "-p", "no:cacheprovider", *sys.argv[1:]]
    sys.exit(pytest.main([str(Path(__file__).parent), *arguments]))
