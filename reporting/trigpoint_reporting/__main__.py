"""Start the command line, so that a stop while it is being loaded is as quiet as any other."""

from __future__ import annotations

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Load the command line, which takes a moment, and run it."""
    try:
        from trigpoint_reporting.cli import main as run
    except KeyboardInterrupt:
        sys.exit(2)
    run()


if __name__ == "__main__":
    main()
