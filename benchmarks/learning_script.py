"""The command line of the scripts that learn, on rendered scenes, a file that is shipped."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from thingmap.datasets.errors import UserError


def run_script(
    arguments: Sequence[str] | None, about: str | None, shipped: Path, learn: Callable[[Path, Path, bool], None]
) -> int:
    """Asks where the scenes and the file go, and learns; 2 for a user's mistake.

    Args:
        arguments: of the command line; None for the process's.
        about: the script's docstring.
        shipped: what `--write` replaces.
        learn: is given the scenes' folder, the file to write, and whether it shall be quick.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, metavar="DIR", help="keep scenes there; scenes in it are used again")
    parser.add_argument("--quick", action="store_true", help="few frames, to see whether everything works")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--write", action="store_true", help="replace what is shipped")
    group.add_argument("-o", "--output", type=Path, metavar="FILE", help="write it there")
    options = parser.parse_args(arguments)
    if options.write and options.quick:
        parser.error("--write is for all scenes")
    with tempfile.TemporaryDirectory() as temporary:
        try:
            learn(options.folder or Path(temporary), options.output or shipped, options.quick)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    return 0
