"""The program `graupel` that comes with the package."""
import os
import sys
from pathlib import Path

PROGRAM = Path(__file__).parent / "bin" / "graupel"


def main() -> None:
    """Becomes the program, with the arguments of this process."""
    if not PROGRAM.is_file():
        sys.exit(f"graupel: the program is not in {PROGRAM.parent}. Install the wheel that 'pip wheel .' makes")
    os.execv(PROGRAM, [str(PROGRAM), *sys.argv[1:]])
